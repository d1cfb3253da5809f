// The input of calibrate_camera(): the codes of a sample of the pixels that see a monitor.
#pragma once

#include <absl/status/statusor.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/import/mapped_archive.h"

namespace glasswing {

enum class Shown { kStripe, kBlack, kWhite };
inline constexpr std::array kAllShown = {Shown::kStripe, Shown::kBlack, Shown::kWhite};

struct SampledMonitor {
  // For each take, in capture order, the codes of all pixels, r, g, b.
  using Takes = std::vector<std::vector<std::uint16_t>>;

  std::string name;
  std::vector<double> radius2;  // by pixel: squared distance from the picture's middle, 1 in its corners
  std::vector<std::array<Takes, 3>> frames;  // [exposure][Shown]

  size_t sample_count() const { return radius2.size() * 3; }
  const Takes& takes(size_t exposure, Shown shown) const {
    return frames[exposure][static_cast<size_t>(shown)];
  }
};

struct CalibrationSamples {
  std::vector<double> exposures_ms;      // as reported by the camera, rising
  std::vector<SampledMonitor> monitors;  // that the camera sees
  std::vector<std::string> unseen;
};

// FAILED_PRECONDITION: the archive's plan is not a camera calibration, frames are missing, or the camera sees
// no monitor.
absl::StatusOr<CalibrationSamples> sample_calibration(const MappedArchive& archive);

// The 99 % quantile of one or more values: a maximum without outliers.
template <typename Value>
Value brightest(std::vector<Value> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace glasswing
