#include "solver/background/difference_noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace glasswing {
namespace {

constexpr double kLeastVariance = 1.0 / 12.0 / 65535.0 / 65535.0;  // of rounding to 16 bits
constexpr double kMost = 9.0;                                      // variances that a square may have
// What is left of the variance of normal differences: E[z^2 | z^2 < 9].
constexpr double kTrimmedMean = 0.9733;

using Vector = Eigen::Vector3d;

Vector columns_of(const DifferenceSample& sample) {
  return {1.0, sample.level, sample.range * sample.range};
}

// Least squares with no weight below 0: of all sets of columns that give none, the one that fits best. Three
// columns, seven sets.
Vector non_negative(const Eigen::Matrix3d& squares, const Vector& products) {
  Vector best = Vector::Zero();
  double best_gain = 0.0;
  for (int set = 1; set < 8; ++set) {
    Eigen::Matrix3d normal = squares;
    Vector right = products;
    for (int i = 0; i < 3; ++i) {
      if (set >> i & 1) continue;
      normal.row(i).setZero();
      normal.col(i).setZero();
      normal(i, i) = 1.0;
      right[i] = 0.0;
    }
    const Vector weights = normal.ldlt().solve(right);
    const double gain = weights.dot(products);
    if (weights.allFinite() && weights.minCoeff() >= 0.0 && gain > best_gain) {
      best = weights;
      best_gain = gain;
    }
  }
  return best;
}

double median_square(std::span<const DifferenceSample> samples) {
  std::vector<double> squares;
  squares.reserve(samples.size());
  for (const DifferenceSample& sample : samples) squares.push_back(sample.square);
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return *middle;
}

}  // namespace

DifferenceNoise fit_difference_noise(std::span<const DifferenceSample> samples, bool several) {
  constexpr int kRounds = 20;
  constexpr double kNormalMedian = 0.4549;  // of z^2
  DifferenceNoise noise;
  noise.weight[0] = std::max(median_square(samples) / (several ? 1.0 : kNormalMedian), kLeastVariance);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Vector products = Vector::Zero();
    for (const DifferenceSample& sample : samples) {
      const double variance = noise.variance(sample.level, sample.range);
      if (!several && sample.square > kMost * variance) continue;
      const Vector columns = columns_of(sample) / variance;
      squares += columns * columns.transpose();
      products += columns * (sample.square / variance / (several ? 1.0 : kTrimmedMean));
    }
    Vector weights = non_negative(squares, products);
    weights[0] = std::max(weights[0], kLeastVariance);
    std::copy(weights.begin(), weights.end(), noise.weight.begin());
  }
  return noise;
}

}  // namespace glasswing
