// What is known about a footprint within a pixel. Pixels are flat, so patterns give no information about a
// position within one: if a footprint sees little more than one pixel along an axis, its centre is uncertain
// by at most the deviation of a uniform distribution over a pixel, and its variance by at most that
// distribution's variance.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/footprint/footprint.h"

namespace glasswing {

inline constexpr double kOnePixel_px2 = 0.25;  // a footprint sees little more than one pixel

// The inverse variances of x, y, xx, xy, yy that this gives, px^-2 and px^-4; 0 along an axis that sees
// several pixels.
inline std::array<double, 5> known_within_pixel(const Footprint& mode) {
  constexpr double kPixel_px2 = 1.0 / 12.0;
  constexpr double kCentre = 1.0 / kPixel_px2, kSpread = kCentre * kCentre;
  const bool x = mode.xx_px2 <= kOnePixel_px2, y = mode.yy_px2 <= kOnePixel_px2;
  return {x ? kCentre : 0.0, y ? kCentre : 0.0, x ? kSpread : 0.0, x || y ? kSpread : 0.0, y ? kSpread : 0.0};
}

// How far the centre of one that sees two pixels may be off, px, rms of x and y, because its shape is not
// known. Flat pixels show a centre at c + (1 / pi) sin(2 pi c) E, where E is the footprint's characteristic
// function at 2 pi: exp(-2 pi^2 sigma^2) of a Gaussian, sin(pi w) / (pi w) of a box of width w = sqrt(12)
// sigma. The error is the difference between the two; for wider footprints, the samples determine the shape.
inline double shape_error_px(const Footprint& mode) {
  constexpr double kPi = std::numbers::pi;
  const auto square = [](double variance_px2) {
    if (variance_px2 > kOnePixel_px2) return 0.0;
    const double variance = std::max(variance_px2, 1e-6), angle = kPi * std::sqrt(12.0 * variance);
    const double error = (std::exp(-2.0 * kPi * kPi * variance) - std::sin(angle) / angle) / kPi;
    return error * error;
  };
  return std::sqrt(0.5 * (square(mode.xx_px2) + square(mode.yy_px2)));
}

}  // namespace glasswing
