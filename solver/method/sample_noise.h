// The noise of a camera sample by the photon-transfer model: variance = read_sd^2 + gain * radiance.
#pragma once

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct SampleNoise {
  double read_sd = 0.0;
  double gain = 0.0;
  double variance(double radiance) const;
};

// The camera's noise, at least its quantisation. `unknown_sd` replaces read noise that the manifest lacks.
SampleNoise sample_noise(const v1::Camera& camera, double unknown_sd);

}  // namespace glasswing
