// Detects problems in the frames of a camera's calibration: automatic exposure, gain or white balance,
// flickering light, clipped codes. Findings are displayable texts, with advice.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <string>
#include <vector>

#include "core/calibration/calibration_samples.h"
#include "core/radiometry/frame_light.h"

namespace glasswing {

// Relative change beyond which a camera must have adjusted itself: errors of shutters and curves are smaller.
inline constexpr double kOwnChange = 0.03;

// FAILED_PRECONDITION: frames do not get brighter with their exposure time. `black_level` (by channel) and
// `saturation` are codes.
absl::Status check_codes_follow(const CalibrationSamples& samples, const std::array<double, 3>& black_level,
                                double saturation);

// The largest deviation of fitted exposure times from declared ones: |ratio - 1|, and a text that names it.
struct TimesOff {
  double max = 0.0;
  std::string text;
};
TimesOff times_off(const std::vector<double>& declared_ms, const std::vector<double>& fitted_s);

// Human-readable warnings. `calibration` has curves, saturation, read_sd and shot_gain. Flicker is reported
// if it adds more than 5 % to the noise of a bright pixel.
std::vector<std::string> symptoms(const CalibrationSamples& samples, const v1::CameraCalibration& calibration,
                                  const FrameLight& light);

}  // namespace glasswing
