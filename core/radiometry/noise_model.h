// The noise of a camera by photon transfer (Janesick 2007; EMVA 1288): for pixels seen repeatedly in constant
// light,
//
//   variance = read_sd^2 + gain * value
//
// value is the code above the black level; codes are on the scale 1 = full. read_sd is the noise of readout
// and quantisation, gain the code per electron. The model holds for linear codes, such as those of raw
// cameras.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <span>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

// As in v1::Camera, with standard errors (one sigma).
struct NoiseModel {
  double read_sd = 0.0, read_sd_error = 0.0;  // 0: too small to measure
  double gain = 0.0, gain_error = 0.0;
  double misfit = 0.0;       // chi^2 per degree of freedom; above 1 it inflates the errors
  double pixel_share = 0.0;  // of samples used by the fit; the rest is clipped or moved
  // The code where samples pile up; absent if no scene is that bright.
  std::optional<double> saturation;

  double variance(double value) const { return read_sd * read_sd + gain * (value > 0.0 ? value : 0.0); }
};

// `scenes[s]` holds two or more frames of one still scene; together the scenes should range from dark to
// bright. Frames of a scene may differ in overall brightness (flicker): each is first scaled to their mean.
// Brightness levels at which codes reach 0 or saturation are left out, as are outlier pixels.
// INVALID_ARGUMENT: no scene, a scene with a single frame or with frames of different sizes, or a black level
// outside [0, 0.5]. FAILED_PRECONDITION: the scenes cover too few unclipped brightness levels, or their
// frames are identical.
absl::StatusOr<NoiseModel> fit_noise(std::span<const std::vector<Image16>> scenes, double black_level);

}  // namespace glasswing
