// The logarithm of a camera's curve, as CameraResponse fits it:
//
//   ln f(z) = ln(z - black) + s(z)
//
// s is straight between knots at the codes k / 255, so that the whole is smooth down to black, whatever the
// camera. Codes are on the scale 1 = full.
#pragma once

#include <Eigen/Dense>
#include <array>

#include "core/radiometry/camera_response.h"

namespace glasswing {

struct KnotPlace {
  int knot;
  double above;  // share of the next knot
};
KnotPlace knot_place_of(double code);

// ln x, and below 1 straight on, so that it is there for codes below black too.
double soft_log(double x);

class LogCurve {
 public:
  using Knots = std::array<double, CameraResponse::kKnots>;

  // A power law. `black` is a code.
  explicit LogCurve(double black);

  double operator()(double code) const;
  double at_knot(size_t k) const { return values_[k]; }
  // d ln f / d code, over a share of the code, as single steps are noisy; cameras' curves are never all flat.
  double slope(double code) const;
  // The code of which ln f is `value`, in [0, 1].
  double code_of(double value) const;

  // s, at the knots.
  const Knots& rest() const { return rest_; }
  // Adds to s. Where the curve would fall, neighbouring knots become their weighted mean.
  void add(const Eigen::VectorXd& change, const Eigen::VectorXd& weights);

 private:
  double black_;  // in knots
  Knots base_{}, rest_{}, values_{};
};

}  // namespace glasswing
