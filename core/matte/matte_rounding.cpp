#include "core/matte/matte_rounding.h"

#include <cmath>

namespace glasswing {
namespace {

constexpr double kShare = 1.0 / 16.0;  // of an error

// The largest power of two that is at most kShare of an error above 0.
double step_of(double error) {
  return std::ldexp(1.0, std::ilogb(kShare * error));
}

double nearest(double value, double step) {
  return step * std::nearbyint(value / step);
}

// To seven binary digits.
float two_digits(float error) {
  return error > 0.0f ? static_cast<float>(nearest(error, std::ldexp(1.0, std::ilogb(error) - 6))) : error;
}

double smaller_variance(const Mode& mode) {
  const double mean = 0.5 * (double{mode.xx_px2} + mode.yy_px2);
  const double half = 0.5 * (double{mode.xx_px2} - mode.yy_px2);
  return std::max(0.0, mean - std::hypot(half, double{mode.xy_px2}));
}

void round_covariance(Mode& mode) {
  const double error = 2.0 * std::sqrt(smaller_variance(mode)) * mode.centre_sd_px;
  if (!(error > 0.0)) return;
  const double step = step_of(error);
  mode.xx_px2 = static_cast<float>(step * std::ceil(mode.xx_px2 / step));
  mode.yy_px2 = static_cast<float>(step * std::ceil(mode.yy_px2 / step));
  mode.xy_px2 = static_cast<float>(step * std::trunc(mode.xy_px2 / step));
}

void round_mode(Mode& mode) {
  if (mode.weight_sd > 0.0f) {
    const auto weight = static_cast<float>(nearest(mode.weight, step_of(mode.weight_sd)));
    if (weight > 0.0f) mode.weight = weight;  // else it would no longer be a mode
  }
  if (mode.centre_sd_px > 0.0f) {
    const double step = step_of(mode.centre_sd_px);
    mode.x_px = static_cast<float>(nearest(mode.x_px, step));
    mode.y_px = static_cast<float>(nearest(mode.y_px, step));
    round_covariance(mode);
  }
  mode.weight_sd = two_digits(mode.weight_sd);
  mode.centre_sd_px = two_digits(mode.centre_sd_px);
}

}  // namespace

void round_to_errors(Matte& matte) {
  const int channels = matte.is_colourless() ? 1 : kChannels;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < channels; ++c) {
        for (Mode& mode : matte.modes(x, y, c)) {
          if (mode.weight > 0.0f) round_mode(mode);
        }
      }
    }
  }
}

}  // namespace glasswing
