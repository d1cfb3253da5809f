#include "solver/method/exposure_changes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/status.h"
#include "core/image/mosaic.h"
#include "core/radiometry/frame_light.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr int kStillRows = 32;
constexpr size_t kMinStill = 200;  // samples of a channel
constexpr float kStill = 0.015f;   // differences between a still sample's frames, except for a few frames
constexpr size_t kOdd = 4;         // one frame in this many may differ
constexpr float kDark = 0.05f;     // samples below are mostly noise
constexpr float kSame = 0.005f, kMaxChange = 0.3f;

float median(std::vector<float>& values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool exposure_is_known(const v1::CaptureManifest& manifest) {
  return std::ranges::any_of(manifest.frames(), [](const v1::Frame& frame) {
    return is_black(frame) || frame.exposure_start_ns() > 0;
  });
}

}  // namespace

absl::StatusOr<std::vector<std::array<float, 3>>> measure_exposure_changes(
    const v1::CaptureManifest& manifest, const RowReader& read) {
  const size_t count = manifest.frames_size();
  if (count < 2 * kOdd || exposure_is_known(manifest)) return std::vector<std::array<float, 3>>();
  GW_ASSIGN_OR_RETURN(const FrameLight light, FrameLight::create(manifest));
  const std::optional<Mosaic> mosaic = mosaic_of(manifest.camera());
  std::vector<int> frames(count);
  std::iota(frames.begin(), frames.end(), 0);
  const int height = manifest.camera().height_px(), rows = std::min(kStillRows, height);
  std::vector<std::array<std::vector<float>, 3>> ratios(count);  // of still samples
  std::vector<float> values(count), sorted;
  for (int k = 0; k < rows; ++k) {
    const int middle = (2 * k + 1) * height / (2 * rows);
    // Rows of both kinds of a mosaic.
    const int y = mosaic ? std::min(middle / 2 * 2 + k % 2, height - 1) : middle;
    GW_ASSIGN_OR_RETURN(const std::vector<std::uint16_t> samples, read(y, frames));
    const size_t row = samples.size() / count;
    for (size_t at = 0; at < row; ++at) {
      bool saturated = false;
      for (size_t f = 0; f < count; ++f) {
        const std::uint16_t code = samples[f * row + at];
        saturated = saturated || light.saturated(code);
        values[f] = light.light(code, row_channel(mosaic, at, y));
      }
      sorted = values;
      const float usual = median(sorted);
      if (saturated || usual < kDark) continue;
      const size_t odd = std::ranges::count_if(
          values, [&](float value) { return std::abs(value - usual) > kStill * usual; });
      if (odd * kOdd > count) continue;
      const size_t channel = row_channel(mosaic, at, y);
      for (size_t f = 0; f < count; ++f) ratios[f][channel].push_back(values[f] / usual);
    }
  }
  for (const std::vector<float>& own : ratios.front()) {
    if (own.size() < kMinStill) return std::vector<std::array<float, 3>>();
  }
  std::vector<std::array<float, 3>> gains(count);
  bool changed = false;
  for (size_t f = 0; f < count; ++f) {
    for (size_t c = 0; c < 3; ++c) {
      const float gain = median(ratios[f][c]);
      if (std::abs(gain - 1.0f) > kMaxChange) {
        return absl::FailedPreconditionError(
            fmt::format("{} is {:.2f} times as bright as the other photographs, where no pattern changes "
                        "them; 0.7 to 1.3 "
                        "can be corrected: omit it, or lock the camera's exposure",
                        manifest.frames(static_cast<int>(f)).file(), gain));
      }
      gains[f][c] = std::abs(gain - 1.0f) > kSame ? gain : 1.0f;
      changed = changed || gains[f][c] != 1.0f;
    }
  }
  return changed ? gains : std::vector<std::array<float, 3>>();
}

}  // namespace glasswing
