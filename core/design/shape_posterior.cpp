#include "core/design/shape_posterior.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace glasswing {
namespace {

constexpr int kLevels = 4;  // of the prior

double spectrum(double square) {
  double sum = 0.0, at_0 = 0.0;
  for (int l = 0; l < kLevels; ++l) {
    sum += std::ldexp(1.0, 2 * l) *
           std::exp(-std::ldexp(4.0 * std::numbers::pi * std::numbers::pi, 2 * l) * square);
    at_0 += std::ldexp(1.0, 2 * l);
  }
  return sum / at_0;
}

}  // namespace

ShapePosterior::ShapePosterior(std::span<const Frequency> frequencies, const ShapePrior& prior, Part part)
    : covariance_(std::ssize(frequencies), std::ssize(frequencies)) {
  const double sign = part == Part::kReal ? 1.0 : -1.0;
  std::vector<double> root;
  for (const Frequency& f : frequencies)
    root.push_back(std::sqrt(prior.lowest * spectrum(f.x * f.x + f.y * f.y)));
  const auto near = [&](double dx, double dy) {
    return std::exp(-2.0 * std::numbers::pi * std::numbers::pi * prior.rho_px * prior.rho_px *
                    (dx * dx + dy * dy));
  };
  for (Eigen::Index i = 0; i < covariance_.rows(); ++i) {
    for (Eigen::Index k = 0; k <= i; ++k) {
      const Frequency &f = frequencies[i], &g = frequencies[k];
      covariance_(i, k) = covariance_(k, i) = static_cast<float>(
          0.5 * root[i] * root[k] * (near(f.x - g.x, f.y - g.y) + sign * near(f.x + g.x, f.y + g.y)));
    }
  }
}

void ShapePosterior::measure(Eigen::Index i, float noise_variance) {
  const Eigen::VectorXf column =
      covariance_.col(i) / std::sqrt(std::max(covariance_(i, i), 0.0f) + noise_variance);
  covariance_.noalias() -= column * column.transpose();
}

double ShapePosterior::variance(Eigen::Index count) const {
  return covariance_.diagonal().head(count).array().max(0.0f).cast<double>().sum();
}

Eigen::ArrayXf ShapePosterior::gains(Eigen::Index count, float noise_variance) const {
  return covariance_.topLeftCorner(count, count).colwise().squaredNorm().transpose().array() /
         (covariance_.diagonal().head(count).array().max(0.0f) + noise_variance);
}

}  // namespace glasswing
