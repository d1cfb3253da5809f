// What frames for a camera's calibration show that they should not: a camera that sets exposure, gain or
// white balance itself, light that flickers, codes that are clipped. In plain words, with what to do.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <string>
#include <vector>

#include "core/calibration/calibration_samples.h"
#include "core/radiometry/frame_light.h"

namespace glasswing {

// Relative; beyond it a camera has changed by itself: errors of shutters and of curves are smaller.
inline constexpr double kOwnChange = 0.03;

// FAILED_PRECONDITION: frames do not get brighter with their exposure. `black_level` of each channel and
// `saturation` are codes.
absl::Status check_codes_follow(const CalibrationSamples& samples, const std::array<double, 3>& black_level,
                                double saturation);

// How far the exposure times that the frames speak of are from the declared ones: the largest |ratio - 1|,
// and in words which.
struct TimesOff {
  double most = 0.0;
  std::string text;
};
TimesOff times_off(const std::vector<double>& declared_ms, const std::vector<double>& fitted_s);

// `calibration` has curves, saturation, read_sd and shot_gain. Repeats count as flickering if that adds more
// than 5 % to the noise of a bright pixel.
std::vector<std::string> symptoms(const CalibrationSamples& samples, const v1::CameraCalibration& calibration,
                                  const FrameLight& light);

}  // namespace glasswing
