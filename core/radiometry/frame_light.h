// What the samples of an archive's frames stand for, with the calibration of its camera: light, linear, 1.0 =
// that of the code from which on samples are saturated.
//
//   light_c(sample) = curve_c(sample / 65535), straight between the curve's knots and continued below black
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class FrameLight {
 public:
  // Without a calibration samples are light as they are, and saturated at full scale. INVALID_ARGUMENT: a
  // calibration that cannot be one.
  static absl::StatusOr<FrameLight> create(const v1::CaptureManifest& manifest);
  static absl::StatusOr<FrameLight> create(const v1::CameraCalibration& calibration);

  // Below 0 for samples below the black level.
  float light(std::uint16_t sample, int channel) const {
    return light_[static_cast<size_t>(channel)][sample];
  }
  bool saturated(std::uint16_t sample) const { return sample >= saturation_; }
  // Samples are light already.
  bool is_identity() const { return identity_; }

 private:
  FrameLight() = default;

  std::array<std::vector<float>, 3> light_;  // of all 65536 samples
  std::uint16_t saturation_ = 65535;
  bool identity_ = true;
};

// Whether it can be true at all: version, three curves that rise, shares in [0, 1], finite numbers.
// INVALID_ARGUMENT names the field.
absl::Status check_calibration(const v1::CameraCalibration& calibration);

}  // namespace glasswing
