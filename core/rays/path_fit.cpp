#include "core/rays/path_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace glasswing {
namespace {

constexpr int kRounds = 10;
constexpr double kRidge = 1e-6;  // of the weights' sum
constexpr double kMinScatter_px = 0.1;
constexpr int kMaxTerms = 6;

using Row = Eigen::Matrix<double, kMaxTerms, 1>;

Row row_of(const Eigen::Vector2d& step, double unit_px) {
  const Eigen::Vector2d u = step / unit_px;
  Row row;
  row << 1.0, u.x(), u.y(), u.x() * u.x(), u.x() * u.y(), u.y() * u.y();
  return row;
}

using WeightedSizes = std::vector<std::pair<double, double>>;

double weighted_median(WeightedSizes& sizes, double total) {
  std::ranges::sort(sizes);
  double left = 0.5 * total;
  for (const auto& [size, weight] : sizes) {
    left -= weight;
    if (left <= 0.0) return size;
  }
  return sizes.back().first;
}

// How far each step lies from the middle of all, in medians of that.
std::vector<double> leverages(std::span<const PathSample> samples, double total) {
  Eigen::Vector2d middle;
  for (int axis = 0; axis < 2; ++axis) {
    WeightedSizes along;
    for (const PathSample& sample : samples) along.emplace_back(sample.step[axis], sample.weight);
    middle[axis] = weighted_median(along, total);
  }
  WeightedSizes sizes;
  for (const PathSample& sample : samples) sizes.emplace_back((sample.step - middle).norm(), sample.weight);
  WeightedSizes ordered = sizes;
  const double usual = std::max(weighted_median(ordered, total), kMinScatter_px);
  std::vector<double> all;
  for (const auto& [size, weight] : sizes) all.push_back(size / usual);
  return all;
}

}  // namespace

PathFit fit_path(std::span<const PathSample> samples, PathShape shape, double unit_px) {
  const int terms = static_cast<int>(shape);
  double total = 0.0, scatter = 1.0;
  for (const PathSample& sample : samples) total += sample.weight;
  // The start doubts those that lie apart: they would bend it to themselves.
  std::vector<double> off_px = leverages(samples, total);
  PathFit fit;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kMaxTerms, kMaxTerms> normal = Eigen::Matrix<double, kMaxTerms, kMaxTerms>::Zero();
    Eigen::Matrix<double, kMaxTerms, 2> right = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const double z = off_px[i] / scatter, weight = samples[i].weight / (1.0 + z * z);
      const Row row = row_of(samples[i].step, unit_px);
      normal += weight * row * row.transpose();
      right += weight * row * samples[i].seen.transpose();
    }
    Eigen::MatrixXd left = normal.topLeftCorner(terms, terms);
    left.diagonal().array() += kRidge * total;
    Eigen::Matrix<double, kMaxTerms, 2> found = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    found.topRows(terms) = left.ldlt().solve(right.topRows(terms));
    double squares = 0.0;
    WeightedSizes sizes;
    for (size_t i = 0; i < samples.size(); ++i) {
      const Row row = row_of(samples[i].step, unit_px);
      off_px[i] = (found.transpose() * row - samples[i].seen).norm();
      squares += samples[i].weight * off_px[i] * off_px[i];
      sizes.emplace_back(off_px[i], samples[i].weight);
    }
    scatter = std::max(weighted_median(sizes, total), kMinScatter_px);
    fit = {.at_start = found.row(0).transpose(), .rms_px = std::sqrt(0.5 * squares / total)};
  }
  return fit;
}

}  // namespace glasswing
