#include "solver/background/difference_noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>

namespace glasswing {
namespace {

constexpr double kMax = 9.0;  // the largest square that is not trimmed, in variances
// The variance of trimmed normal differences: E[z^2 | z^2 < 9].
constexpr double kTrimmedMean = 0.9733;

using Vector = Eigen::Vector3d;

Vector columns_of(const DifferenceSample& sample) {
  return {1.0, sample.level, sample.range * sample.range};
}

// Non-negative least squares: the best fit of all sets of columns whose weights are not negative. Three
// columns give seven sets.
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

// The index of one of this many equal parts.
std::span<DifferenceSample> part_of(std::span<DifferenceSample> all, size_t part, size_t parts) {
  const size_t begin = all.size() * part / parts, end = all.size() * (part + 1) / parts;
  return all.subspan(begin, end - begin);
}

double median_square(std::span<DifferenceSample> samples) {
  const auto middle = samples.begin() + samples.size() / 2;
  std::nth_element(samples.begin(), middle, samples.end(),
                   [](const DifferenceSample& a, const DifferenceSample& b) { return a.square < b.square; });
  return middle->square;
}

// First fit: to the medians of 8 x 4 groups of samples of similar level and range, equally weighted, so a
// group full of object has no more influence than any other.
Vector fit_to_lots(std::span<DifferenceSample> samples, double median, double least) {
  constexpr size_t kLevels = 8, kRanges = 4;
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Vector products = Vector::Zero();
  std::ranges::sort(samples, {}, &DifferenceSample::level);
  for (size_t i = 0; i < kLevels; ++i) {
    const std::span<DifferenceSample> alike = part_of(samples, i, kLevels);
    std::ranges::sort(alike, {}, &DifferenceSample::range);
    for (size_t j = 0; j < kRanges; ++j) {
      const std::span<DifferenceSample> lot = part_of(alike, j, kRanges);
      if (lot.empty()) continue;
      const double variance = std::max(median_square(lot) / median, least);
      Vector mean = Vector::Zero();
      for (const DifferenceSample& sample : lot) mean += columns_of(sample);
      const Vector columns = mean / (static_cast<double>(lot.size()) * variance);
      squares += columns * columns.transpose();
      products += columns;
    }
  }
  return non_negative(squares, products);
}

}  // namespace

DifferenceNoise fit_difference_noise(std::vector<DifferenceSample> samples, bool several, double least) {
  constexpr int kRounds = 20;
  constexpr double kNormalMedian = 0.4549;  // of z^2
  DifferenceNoise noise;
  const auto take = [&](Vector weights) {
    weights[0] = std::max(weights[0], least);
    std::copy(weights.begin(), weights.end(), noise.weight.begin());
  };
  take(fit_to_lots(samples, several ? 1.0 : kNormalMedian, least));
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Vector products = Vector::Zero();
    for (const DifferenceSample& sample : samples) {
      const double variance = noise.variance(sample.level, sample.range);
      if (!several && sample.square > kMax * variance) continue;
      const Vector columns = columns_of(sample) / variance;
      squares += columns * columns.transpose();
      products += columns * (sample.square / variance / (several ? 1.0 : kTrimmedMean));
    }
    take(non_negative(squares, products));
  }
  if (several || samples.empty()) return noise;
  // Trimming may never converge for differences that are far from normal. An object that covers less than
  // half of the picture does not make their median this large.
  constexpr double kMaxMedian = 4.0 * kNormalMedian;
  for (DifferenceSample& sample : samples) sample.square /= noise.variance(sample.level, sample.range);
  const double median = median_square(samples);
  if (median > kMaxMedian) {
    for (double& weight : noise.weight) weight *= median / kNormalMedian;
  }
  return noise;
}

}  // namespace glasswing
