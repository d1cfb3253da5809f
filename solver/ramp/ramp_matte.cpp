#include "solver/ramp/ramp_matte.h"

#include <atomic>
#include <cmath>

#include "core/base/for_rows.h"
#include "solver/ramp/ramp_footprint.h"

namespace glasswing {
namespace {

constexpr double kCovered = 0.98;  // of the ramp's pixels: no background is left

}  // namespace

Matte matte_of(const RampStage& stage, const v1::MatteMetadata& metadata, const RampFrame& frame,
               int thread_count) {
  const int width = frame.width_px, height = frame.height_px;
  Matte matte(0, 0, width, height, 2, true);
  matte.metadata = metadata;
  const size_t row = width;
  // The variance of a box is side^2 / 12.
  const auto box = [&](float weight, float x_px, float y_px, float side_x_px, float side_y_px) {
    Mode mode;
    mode.weight = weight;
    mode.x_px = x_px;
    mode.y_px = y_px;
    mode.xx_px2 = side_x_px * side_x_px / 12.0f;
    mode.yy_px2 = side_y_px * side_y_px / 12.0f;
    mode.texture = stage.texture;
    return mode;
  };
  std::atomic<size_t> ramp = 0, covered = 0;
  for_rows(height, thread_count, [&](int first, int last) {
    size_t at = static_cast<size_t>(first) * row, own_ramp = 0, own_covered = 0;
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < width; ++x, ++at) {
        matte.flags(x, y) = frame.flags[at];
        const float alpha = frame.alpha[at], f = frame.highlight[at];
        matte.coverage(x, y) = alpha;
        matte.foreground(x, y) = {f, f, f};
        if (stage.behind[at] == Behind::kRamp) ++own_ramp;
        if (stage.behind[at] == Behind::kRamp && alpha > 0.0f) ++own_covered;
        std::span<Mode> modes = matte.modes(x, y, 0);
        if (alpha < 1.0f && stage.behind[at] == Behind::kRamp) {
          const std::array<double, 4> slope = stage.map.slope(x + 0.5, y + 0.5);
          modes.front() = box(1.0f - alpha, stage.x_px[at], stage.y_px[at],
                              static_cast<float>(std::hypot(slope[0], slope[1])),
                              static_cast<float>(std::hypot(slope[2], slope[3])));
          modes = modes.subspan(1);
        }
        if (alpha == 0.0f || frame.rho[at] == 0.0f) continue;
        const RampFootprint wide = ramp_footprint(frame, x, y);
        Mode& mode = modes.front();
        mode = box(frame.rho[at], frame.x_px[at], frame.y_px[at], wide.width_px, wide.height_px);
        const float determinant =
            frame.info_xx[at] * frame.info_yy[at] - frame.info_xy[at] * frame.info_xy[at];
        if (determinant > 0.0f)
          mode.centre_sd_px = std::sqrt(0.5f * (frame.info_xx[at] + frame.info_yy[at]) / determinant);
      }
    }
    ramp += own_ramp;
    covered += own_covered;
  });
  if (static_cast<double>(covered.load()) > kCovered * static_cast<double>(ramp.load())) {
    matte.metadata.add_warnings(
        "the object covers all of the background: nothing tells whether that still is where it was without "
        "the object");
  }
  return matte;
}

}  // namespace glasswing
