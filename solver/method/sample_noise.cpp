#include "solver/method/sample_noise.h"

#include <algorithm>
#include <cmath>

namespace glasswing {

double SampleNoise::variance(double radiance) const {
  return read_sd * read_sd + gain * std::max(radiance, 0.0);
}

SampleNoise sample_noise(const v1::Camera& camera, double unknown_sd) {
  const double bits = camera.bits() >= 1 && camera.bits() <= 16 ? camera.bits() : 16;
  const double quantisation_sd = 1.0 / ((std::exp2(bits) - 1.0) * std::sqrt(12.0));
  return {.read_sd = std::hypot(camera.read_sd() > 0.0 ? camera.read_sd() : unknown_sd, quantisation_sd),
          .gain = std::max(camera.gain(), 0.0)};
}

}  // namespace glasswing
