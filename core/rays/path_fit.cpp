#include "core/rays/path_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/median.h"

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

// How far each step lies from the centre of all, in medians of that.
std::vector<double> leverages(std::span<const PathSample> samples) {
  Eigen::Vector2d middle;
  for (int axis = 0; axis < 2; ++axis) {
    WeightedValues along;
    for (const PathSample& sample : samples) along.emplace_back(sample.step[axis], sample.weight);
    middle[axis] = weighted_median(std::move(along));
  }
  WeightedValues sizes;
  for (const PathSample& sample : samples) sizes.emplace_back((sample.step - middle).norm(), sample.weight);
  const double usual = std::max(weighted_median(sizes), kMinScatter_px);
  std::vector<double> all;
  for (const auto& [size, weight] : sizes) all.push_back(size / usual);
  return all;
}

}  // namespace

PathFit fit_path(std::span<const PathSample> samples, PathShape shape, double unit_px) {
  const int terms = static_cast<int>(shape);
  double total = 0.0, scatter = 1.0;
  std::vector<Row> rows;
  for (const PathSample& sample : samples) {
    rows.push_back(row_of(sample.step, unit_px));
    total += sample.weight;
  }
  // The start gives little weight to distant ones, which would pull it towards themselves.
  std::vector<double> off_px = leverages(samples);
  PathFit fit;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kMaxTerms, kMaxTerms> normal = Eigen::Matrix<double, kMaxTerms, kMaxTerms>::Zero();
    Eigen::Matrix<double, kMaxTerms, 2> right = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const double z = off_px[i] / scatter, weight = samples[i].weight / (1.0 + z * z);
      normal += weight * rows[i] * rows[i].transpose();
      right += weight * rows[i] * samples[i].seen.transpose();
    }
    Eigen::MatrixXd left = normal.topLeftCorner(terms, terms);
    left.diagonal().array() += kRidge * total;
    Eigen::Matrix<double, kMaxTerms, 2> found = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    found.topRows(terms) = left.ldlt().solve(right.topRows(terms));
    double squares = 0.0;
    WeightedValues sizes;
    for (size_t i = 0; i < samples.size(); ++i) {
      off_px[i] = (found.transpose() * rows[i] - samples[i].seen).norm();
      squares += samples[i].weight * off_px[i] * off_px[i];
      sizes.emplace_back(off_px[i], samples[i].weight);
    }
    scatter = std::max(weighted_median(std::move(sizes)), kMinScatter_px);
    fit = {.at_start = found.row(0).transpose(), .rms_px = std::sqrt(0.5 * squares / total)};
  }
  return fit;
}

}  // namespace glasswing
