// What calibrate_camera() looks at: the codes of a sample of the pixels that see a monitor.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/import/mapped_archive.h"

namespace glasswing {

enum class Shown { kStripe, kBlack, kWhite };
inline constexpr std::array kAllShown = {Shown::kStripe, Shown::kBlack, Shown::kWhite};

struct SampledMonitor {
  // Codes of all pixels, r, g, b, of each take, in the order in which they were taken.
  using Takes = std::vector<std::vector<std::uint16_t>>;

  std::string name;
  std::vector<double> radius2;  // of each pixel: squared distance from the picture's middle, 1 in its corners
  std::vector<std::array<Takes, 3>> frames;  // [exposure][Shown]

  size_t sample_count() const { return radius2.size() * 3; }
  const Takes& takes(size_t exposure, Shown shown) const {
    return frames[exposure][static_cast<size_t>(shown)];
  }
};

struct CalibrationSamples {
  std::vector<double> exposures_ms;      // as the camera reported them, rising
  std::vector<SampledMonitor> monitors;  // those that the camera sees
  std::vector<std::string> unseen;
};

// FAILED_PRECONDITION: the archive's plan is no calibration of a camera, frames are missing, no monitor is
// seen.
absl::StatusOr<CalibrationSamples> sample_calibration(const MappedArchive& archive);

}  // namespace glasswing
