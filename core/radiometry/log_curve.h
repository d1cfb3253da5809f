// The logarithm of a camera's curve, as CameraResponse fits it:
//
//   ln f(z) = ln(z - black) + s(z)
//
// s is linear between knots at the codes k / 255, so that the sum is smooth down to black for any camera.
// Codes are on the scale 1 = full.
#pragma once

#include <Eigen/Dense>
#include <array>

#include "core/radiometry/camera_response.h"

namespace glasswing {

inline constexpr int kKnots = CameraResponse::kKnots;
inline constexpr double kKnotsPerCode = kKnots - 1;

struct KnotPosition {
  int knot;
  double above;  // share of the next knot
};
KnotPosition knot_position_of(double code);

// ln x, continued below 1 by its tangent, so that it is defined for codes below black.
double soft_log(double x);

class LogCurve {
 public:
  using Knots = std::array<double, kKnots>;

  // Starts as a power law. `black` is a code.
  explicit LogCurve(double black);

  double operator()(double code) const;
  double at_knot(size_t k) const { return values_[k]; }
  // d ln f / d code, averaged over a range of codes, since single steps are noisy. Never 0: no camera's curve
  // is flat.
  double slope(double code) const;
  // The code in [0, 1] where ln f is `value`.
  double code_of(double value) const;

  // s at the knots.
  const Knots& rest() const { return rest_; }
  // Adds to s. Where the curve would fall, neighbouring knots are pooled to their weighted mean.
  void add(const Eigen::VectorXd& change, const Eigen::VectorXd& weights);

 private:
  double black_;  // in knots
  Knots base_{}, rest_{}, values_{};
};

}  // namespace glasswing
