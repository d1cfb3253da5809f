// The noise of a camera by photon transfer (Janesick 2007; EMVA 1288): of pixels seen repeatedly in constant
// light,
//
//   variance = read_sd^2 + gain * value
//
// value is the code above the black level; codes are on the scale 1 = full. read_sd holds the readout's and
// the quantisation's noise, gain is the code that one electron makes. It holds for linear codes, such as a
// raw camera's.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <span>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

// As in v1::Camera, with standard errors (one sigma).
struct NoiseModel {
  double read_sd = 0.0, read_sd_error = 0.0;  // 0: less than can be told
  double gain = 0.0, gain_error = 0.0;
  double misfit = 0.0;       // chi^2 per degree of freedom; the errors allow for what is above 1
  double pixel_share = 0.0;  // of the samples that the fit used; the rest is clipped, or moved
  // Where codes pile up, as a code; absent if none of the scenes is so bright.
  std::optional<double> saturation;

  double variance(double value) const { return read_sd * read_sd + gain * (value > 0.0 ? value : 0.0); }
};

// `scenes[s]` are two frames or more of one still scene; together they should reach from dark to bright.
// Frames of a scene may differ in brightness as a whole (flicker): each is first scaled to their mean. Where
// codes reach 0 or the saturation, pixels of that brightness are left out, as is one whose variance is far
// beyond its like. INVALID_ARGUMENT: no scene, one with a single frame or of several sizes, a black level
// outside [0, 0.5]. FAILED_PRECONDITION: the scenes do not cover enough brightnesses that are not clipped;
// frames are identical.
absl::StatusOr<NoiseModel> fit_noise(std::span<const std::vector<Image16>> scenes, double black_level);

}  // namespace glasswing
