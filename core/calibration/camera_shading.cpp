#include "core/calibration/camera_shading.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kNear = 0.35, kFar = 0.7;  // r
constexpr double kEdge = 0.02;              // quantile of points
constexpr double kOutlier = 4.0;            // standard deviations
constexpr int kPasses = 10;

double quantile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::optional<v1::FallOff> fit_camera_shading(const std::vector<ShadingPoint>& points) {
  if (points.empty()) return std::nullopt;
  size_t groups = 0;
  std::vector<double> radius2;
  for (const ShadingPoint& point : points) {
    groups = std::max(groups, point.group + 1);
    radius2.push_back(point.radius2);
  }
  if (quantile(radius2, kEdge) > kNear * kNear || quantile(radius2, 1.0 - kEdge) < kFar * kFar)
    return std::nullopt;

  // Relative residuals light / (a_g F) - 1, linear in changes of ln a_g, r2 and r4.
  std::vector<double> sum(groups), count(groups);
  for (const ShadingPoint& point : points) sum[point.group] += point.light, count[point.group] += 1.0;
  const auto size = static_cast<Eigen::Index>(groups) + 2;
  Eigen::VectorXd level(size - 2);
  for (size_t g = 0; g < groups; ++g) level[g] = std::log(sum[g] / std::max(count[g], 1.0));
  double r2 = 0.0, r4 = 0.0, max_residual = INFINITY, rms = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    Eigen::MatrixXd normal =
        1e-9 * Eigen::MatrixXd::Identity(size, size);  // keeps groups without points solvable
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    double squares = 0.0, used = 0.0;
    std::vector<double> off;
    for (const ShadingPoint& point : points) {
      const auto group = static_cast<Eigen::Index>(point.group);
      const double shape = 1.0 + r2 * point.radius2 + r4 * point.radius2 * point.radius2;
      const double residual = point.light / (std::exp(level[group]) * shape) - 1.0;
      off.push_back(std::abs(residual));
      if (std::abs(residual) > max_residual) continue;
      const std::array<std::pair<Eigen::Index, double>, 3> row = {
          {{group, 1.0},
           {size - 2, point.radius2 / shape},
           {size - 1, point.radius2 * point.radius2 / shape}}};
      for (const auto& [k, a] : row) {
        for (const auto& [l, b] : row) normal(k, l) += a * b;
        right[k] += a * residual;
      }
      squares += residual * residual, used += 1.0;
    }
    rms = std::sqrt(squares / used);
    max_residual = kOutlier * 1.4826 * quantile(off, 0.5);
    const Eigen::VectorXd change = normal.ldlt().solve(right);
    level += change.head(size - 2);
    r2 += change[size - 2], r4 += change[size - 1];
  }
  v1::FallOff fall_off;
  fall_off.set_r2(r2);
  fall_off.set_r4(r4);
  fall_off.set_residual_rms(rms);
  return fall_off;
}

}  // namespace glasswing
