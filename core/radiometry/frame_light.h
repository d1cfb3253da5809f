// Converts samples of an archive's frames to linear light by the calibration of its camera; 1.0 is the light
// of the saturation code.
//
//   light_c(sample) = curve_c(sample / 65535), linear between the curve's knots; negative below black
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class FrameLight {
 public:
  // Without a calibration, samples are linear light above the camera's black level, and saturate at full
  // scale. INVALID_ARGUMENT: check_calibration() refuses the calibration.
  static absl::StatusOr<FrameLight> create(const v1::CaptureManifest& manifest);
  static absl::StatusOr<FrameLight> create(const v1::CameraCalibration& calibration);
  // `light`: by sample, 65536 entries of which 65535 is 1.0. The highest sample is saturated.
  static FrameLight of_samples(const std::vector<std::uint16_t>& light);

  // Negative for samples below the black level.
  float light(std::uint16_t sample, int channel) const { return light_[channel][sample]; }
  bool saturated(std::uint16_t sample) const { return sample >= saturation_; }
  // True if samples are linear light already.
  bool is_identity() const { return identity_; }

 private:
  FrameLight() = default;

  std::array<std::vector<float>, 3> light_;  // by sample, 65536 entries
  std::uint16_t saturation_ = 65535;
  bool identity_ = true;
};

// Validates a calibration: version, three rising curves, shares in [0, 1], finite numbers. INVALID_ARGUMENT
// names the field.
absl::Status check_calibration(const v1::CameraCalibration& calibration);

}  // namespace glasswing
