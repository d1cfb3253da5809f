#include "solver/footprint/cone_step.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

// The positive semi-definite (xx, xy, yy) nearest to `target` in the metric H: rank one, found along its
// direction.
Eigen::Vector3d nearest_positive(const Eigen::Vector3d& target, const Eigen::Matrix3d& metric) {
  const auto at = [&](double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Eigen::Vector3d(c * c, c * s, s * s);
  };
  const auto gain = [&](double angle) {
    const Eigen::Vector3d a = at(angle);
    const double along = std::max(a.dot(metric * target), 0.0);
    return along * along / a.dot(metric * a);
  };
  constexpr int kDirections = 12;
  double best = 0.0, best_gain = -1.0;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = i * std::numbers::pi / kDirections;
    if (const double g = gain(angle); g > best_gain) best = angle, best_gain = g;
  }
  for (double width = 0.5 * std::numbers::pi / kDirections; width > 1e-4; width *= 0.5) {
    for (const double angle : {best - width, best + width}) {
      if (const double g = gain(angle); g > best_gain) best = angle, best_gain = g;
    }
  }
  const Eigen::Vector3d a = at(best);
  return std::max(a.dot(metric * target), 0.0) / a.dot(metric * a) * a;
}

}  // namespace

Footprints step_within_cone(const Footprints& modes, const Eigen::LLT<FootprintMatrix>& solver,
                            FootprintVector& step) {
  const auto n = step.size();
  FootprintMatrix covariance;  // of the free parameters; computed on first use
  for (int m = 0; m < modes.size(); ++m) {
    const Footprint& mode = modes[m];
    const Eigen::Vector3d now(mode.xx_px2, mode.xy_px2, mode.yy_px2);
    const Eigen::Index block = 6 * m + 3;
    const Eigen::Vector3d free = now + step.segment<3>(block);
    if (free[0] >= 0.0 && free[2] >= 0.0 && free[0] * free[2] >= free[1] * free[1]) continue;
    if (covariance.size() == 0) covariance = solver.solve(FootprintMatrix::Identity(n, n));
    const Eigen::Matrix3d metric = Eigen::Matrix3d(covariance.block<3, 3>(block, block)).inverse();
    const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxParameters, 3> follow =
        covariance.middleCols<3>(block) * metric;
    step += follow * (nearest_positive(free, metric) - free);
    covariance -= follow * FootprintMatrix(covariance.middleRows<3>(block));
  }
  Footprints moved = modes;
  for (int m = 0; m < modes.size(); ++m) {
    Footprint& mode = moved[m];
    const double* d = step.data() + 6 * m;
    mode.weight += d[0];
    mode.x_px += d[1];
    mode.y_px += d[2];
    mode.xx_px2 += d[3];
    mode.xy_px2 += d[4];
    mode.yy_px2 += d[5];
  }
  return moved;
}

}  // namespace glasswing
