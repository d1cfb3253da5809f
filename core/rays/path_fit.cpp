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

double weighted_median(std::vector<std::pair<double, double>>& sizes, double total) {
  std::ranges::sort(sizes);
  double left = 0.5 * total;
  for (const auto& [size, weight] : sizes) {
    left -= weight;
    if (left <= 0.0) return size;
  }
  return sizes.back().first;
}

}  // namespace

PathFit fit_path(std::span<const PathSample> samples, PathShape shape, double unit_px) {
  const int terms = static_cast<int>(shape);
  double total = 0.0, scatter = INFINITY;
  for (const PathSample& sample : samples) total += sample.weight;
  std::vector<double> off_px(samples.size(), 0.0);
  PathFit fit;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kMaxTerms, kMaxTerms> normal = Eigen::Matrix<double, kMaxTerms, kMaxTerms>::Zero();
    Eigen::Matrix<double, kMaxTerms, 2> right = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const double z = off_px[i] / scatter;
      // The start looks twice as far, so that the nearest pair does not decide it.
      const double near = round == 0 ? std::pow(samples[i].weight, 0.25) : samples[i].weight;
      const Row row = row_of(samples[i].step, unit_px);
      normal += near / (1.0 + z * z) * row * row.transpose();
      right += near / (1.0 + z * z) * row * samples[i].seen.transpose();
    }
    Eigen::MatrixXd left = normal.topLeftCorner(terms, terms);
    left.diagonal().array() += kRidge * total;
    Eigen::Matrix<double, kMaxTerms, 2> found = Eigen::Matrix<double, kMaxTerms, 2>::Zero();
    found.topRows(terms) = left.ldlt().solve(right.topRows(terms));
    double squares = 0.0;
    std::vector<std::pair<double, double>> sizes;
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
