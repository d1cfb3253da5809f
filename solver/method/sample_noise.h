// What noise a sample of the camera has, by the photon-transfer model: variance = read_sd^2 + gain *
// radiance.
#pragma once

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Variance of a sample of this radiance.
struct SampleNoise {
  double read_sd = 0.0;
  double gain = 0.0;
  double variance(double radiance) const;
};

// The camera's own, with `unknown_sd` where the manifest names no read noise; never less than its
// quantisation.
SampleNoise sample_noise(const v1::Camera& camera, double unknown_sd);

}  // namespace glasswing
