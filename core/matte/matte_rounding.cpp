#include "core/matte/matte_rounding.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/matte/covariance_axes.h"

namespace glasswing {
namespace {

constexpr double kShare = 1.0 / 16.0;  // of an error
constexpr double kMinWeightError = 1.0 / 4096.0, kMaxWeightError = 1.0 / 512.0;
constexpr double kMinCentreError_px = 1.0 / 64.0;
constexpr double kMaxCentreError = 1.0 / 32.0, kMaxWidthError = 1.0 / 128.0;  // of the width that is seen
constexpr double kPixelVariance_px2 = 1.0 / 12.0;

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
  return std::max(0.0, axis_variances({.xx = mode.xx_px2, .xy = mode.xy_px2, .yy = mode.yy_px2}).narrow);
}

// Of a mode, or the smallest of a pixel's modes where they are known.
struct Errors {
  float weight = 0.0f, centre_px = 0.0f;
};

void round_mode(Mode& mode, const Errors& errors) {
  const double weight_step = step_of(std::clamp<double>(errors.weight, kMinWeightError, kMaxWeightError));
  const auto weight = static_cast<float>(nearest(mode.weight, weight_step));
  if (weight > 0.0f) mode.weight = weight;  // else it would no longer be a mode
  const double seen_px = std::sqrt(smaller_variance(mode) + kPixelVariance_px2);
  const auto centre_error_px = [&](double share) {
    return std::clamp<double>(errors.centre_px, kMinCentreError_px,
                              std::max(kMinCentreError_px, share * seen_px));
  };
  const double step = step_of(centre_error_px(kMaxCentreError));
  mode.x_px = static_cast<float>(nearest(mode.x_px, step));
  mode.y_px = static_cast<float>(nearest(mode.y_px, step));
  const double covariance_step = step_of(2.0 * seen_px * centre_error_px(kMaxWidthError));
  mode.xx_px2 = static_cast<float>(covariance_step * std::ceil(mode.xx_px2 / covariance_step));
  mode.yy_px2 = static_cast<float>(covariance_step * std::ceil(mode.yy_px2 / covariance_step));
  mode.xy_px2 = static_cast<float>(covariance_step * std::trunc(mode.xy_px2 / covariance_step));
  mode.weight_sd = two_digits(mode.weight_sd);
  mode.centre_sd_px = two_digits(mode.centre_sd_px);
}

// To multiples of a sixteenth of the noise: what rounding takes from one coefficient, the next one gets, so
// that it moves light by less than a step.
void round_pyramid(PyramidFootprint& pyramid) {
  if (!(pyramid.noise_sd > 0.0f)) return;
  const double step = step_of(double{pyramid.noise_sd});
  std::ranges::sort(pyramid.coefficients, {},
                    [](const Coefficient& own) { return std::tuple(own.level, own.column, own.row); });
  double left = 0.0;
  for (Coefficient& own : pyramid.coefficients) {
    const double wanted = double{own.weight} + left;
    own.weight = static_cast<float>(std::max(nearest(wanted, step), 0.0));
    left = wanted - double{own.weight};
  }
  std::erase_if(pyramid.coefficients, [](const Coefficient& own) { return !(own.weight > 0.0f); });
}

// The smaller of known errors.
float smaller(float a, float b) {
  return a > 0.0f && b > 0.0f ? std::min(a, b) : std::max(a, b);
}

}  // namespace

void round_to_errors(Matte& matte) {
  if (matte.metadata.footprint() == kBoxFootprint) return;
  const int channels = matte.is_colourless() ? 1 : kChannels;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      Errors least;
      for (int c = 0; c < channels; ++c) {
        for (const Mode& mode : matte.modes(x, y, c)) {
          if (!(mode.weight > 0.0f)) continue;
          least.weight = smaller(least.weight, mode.weight_sd);
          least.centre_px = smaller(least.centre_px, mode.centre_sd_px);
        }
      }
      for (int c = 0; c < channels; ++c) {
        for (PyramidFootprint& pyramid : matte.pyramids(x, y, c)) round_pyramid(pyramid);
        for (Mode& mode : matte.modes(x, y, c)) {
          if (!(mode.weight > 0.0f)) continue;
          round_mode(mode, {.weight = mode.weight_sd > 0.0f ? mode.weight_sd : least.weight,
                            .centre_px = mode.centre_sd_px > 0.0f ? mode.centre_sd_px : least.centre_px});
        }
      }
    }
  }
}

}  // namespace glasswing
