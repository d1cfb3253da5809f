// RampExtractor::matte: the footprints.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "solver/ramp/for_rows.h"
#include "solver/ramp/prepared_stage.h"

namespace glasswing {
namespace {

constexpr float kSurely = 0.3f;    // covered so far, a pixel's c is the object's
constexpr double kCovered = 0.98;  // of what shows the ramp: nothing of the background is left

// Where c can be compared with its neighbours'.
bool is_known(const RampFrame& frame, size_t at) {
  return frame.alpha[at] > kSurely && (frame.info_xx[at] > 0.0f || frame.highlight[at] > 0.0f);
}

// How far c goes from a pixel to the next, from the steps to both neighbours: their harmonic mean, which the
// smaller one rules, so that no footprint spans a jump of c.
float step_between(float before, float after) {
  const float a = std::abs(before), b = std::abs(after);
  return a + b > 0.0f ? 2.0f * a * b / (a + b) : 0.0f;
}

struct Steps {
  float x_px = 0.0f, y_px = 0.0f;
};

// Of c along one axis of the picture; `behind` and `ahead` are 0 where there is no neighbour.
Steps steps_along(const RampFrame& frame, size_t at, size_t behind, size_t ahead) {
  const bool has_behind = behind != 0 && is_known(frame, at - behind);
  const bool has_ahead = ahead != 0 && is_known(frame, at + ahead);
  const auto of = [&](const std::vector<float>& plane) {
    const float before = has_behind ? plane[at] - plane[at - behind] : 0.0f;
    const float after = has_ahead ? plane[at + ahead] - plane[at] : 0.0f;
    if (has_behind && has_ahead) return step_between(before, after);
    return std::abs(before + after);
  };
  return {of(frame.x_px), of(frame.y_px)};
}

}  // namespace

Matte RampExtractor::matte(const RampFrame& frame, int thread_count) const {
  const RampStage& stage = prepared_->stage;
  const int width = frame.width_px, height = frame.height_px;
  Matte matte(0, 0, width, height, 2, true);
  matte.metadata = prepared_->metadata;
  const auto row = static_cast<size_t>(width);
  // sides sqrt(12 xx): variances of boxes.
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
        const Steps across = steps_along(frame, at, x > 0 ? 1 : 0, x + 1 < width ? 1 : 0);
        const Steps down = steps_along(frame, at, y > 0 ? row : 0, y + 1 < height ? row : 0);
        // The ramp does not tell places within a pixel of the monitor apart: c between two pixels is how much
        // of each was seen, which a box of a pixel's width says exactly.
        Mode& mode = modes.front();
        mode = box(frame.rho[at], frame.x_px[at], frame.y_px[at],
                   std::max(1.0f, std::hypot(across.x_px, down.x_px)),
                   std::max(1.0f, std::hypot(across.y_px, down.y_px)));
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

const std::vector<std::string>& RampExtractor::warnings() const {
  return prepared_->stage.warnings;
}

}  // namespace glasswing
