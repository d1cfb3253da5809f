// The axes of a footprint's covariance, a symmetric 2x2 matrix.
#pragma once

#include <algorithm>
#include <cmath>

namespace glasswing {

struct Covariance {
  double xx = 0.0, xy = 0.0, yy = 0.0;
};

// The eigenvalues, wide >= narrow. Rounding may leave a narrow one of 0 slightly below it.
struct AxisVariances {
  double wide = 0.0, narrow = 0.0;
};
inline AxisVariances axis_variances(const Covariance& covariance) {
  const double mean = 0.5 * (covariance.xx + covariance.yy),
               apart = std::hypot(0.5 * (covariance.xx - covariance.yy), covariance.xy);
  return {.wide = mean + apart, .narrow = mean - apart};
}

// The direction of the wide axis, in (-pi/2, pi/2]; 0 for a round covariance.
inline double wide_axis_rad(const Covariance& covariance) {
  return 0.5 * std::atan2(covariance.xy, 0.5 * (covariance.xx - covariance.yy));
}

// The nearest covariance with the same axes and no variance below `min`.
inline Covariance with_min_variance(const Covariance& covariance, double min) {
  const AxisVariances own = axis_variances(covariance);
  if (own.narrow >= min) return covariance;
  const double wide = std::max(own.wide, min), narrow = std::max(own.narrow, min);
  const double mean = 0.5 * (wide + narrow), half = 0.5 * (covariance.xx - covariance.yy);
  const double share = own.wide > own.narrow ? (wide - narrow) / (own.wide - own.narrow) : 0.0;
  return {.xx = mean + share * half, .xy = share * covariance.xy, .yy = mean - share * half};
}

}  // namespace glasswing
