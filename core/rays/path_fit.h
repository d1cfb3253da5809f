// Where the places of one depth lie that those of the other see along one path, near one of them: a
// polynomial f of the step u from it, affine or quadratic, by Cauchy's loss,
//
//   min over f of sum w log(1 + |f(u) - p|^2 / s^2)      s: the median of |f(u) - p|
//
// by reweighting. One pair that joins two paths would turn a least-squares plane through a few pixels.
#pragma once

#include <Eigen/Core>
#include <span>

namespace glasswing {

struct PathSample {
  Eigen::Vector2d step;  // u, px
  Eigen::Vector2d seen;  // p, px
  double weight = 1.0;   // in (0, 1]: of near ones most
};

struct PathFit {
  Eigen::Vector2d at_start = Eigen::Vector2d::Zero();  // f(0), px
  double rms_px = 0.0;                                 // of all residuals along an axis, by their weights
};

enum class PathShape { kAffine = 3, kQuadratic = 6 };  // terms

// `unit_px`: in which steps are about 1. At least one sample.
PathFit fit_path(std::span<const PathSample> samples, PathShape shape, double unit_px);

}  // namespace glasswing
