#include "core/composite/histogram_match.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr int kQuantiles = 1025;

struct Moments {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

Eigen::Vector3d colour_at(const RadianceImage& picture, size_t at) {
  return Eigen::Vector3f(picture.samples[at], picture.samples[at + 1], picture.samples[at + 2])
      .cast<double>();
}

Moments moments_of(const RadianceImage& picture) {
  Moments moments;
  const double count = static_cast<double>(picture.samples.size()) / 3.0;
  for (size_t at = 0; at < picture.samples.size(); at += 3) moments.mean += colour_at(picture, at) / count;
  for (size_t at = 0; at < picture.samples.size(); at += 3) {
    const Eigen::Vector3d off = colour_at(picture, at) - moments.mean;
    moments.covariance += off * off.transpose() / count;
  }
  return moments;
}

// V f(D) V^T; nearly zero eigenvalues count as zero.
template <typename Function>
Eigen::Matrix3d of_eigenvalues(const Eigen::Matrix3d& matrix, const Function& function) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(matrix);
  const double floor = 1e-12 * parts.eigenvalues().maxCoeff();
  Eigen::Vector3d values;
  for (int i = 0; i < 3; ++i)
    values(i) = parts.eigenvalues()(i) > floor ? function(parts.eigenvalues()(i)) : 0.0;
  return parts.eigenvectors() * values.asDiagonal() * parts.eigenvectors().transpose();
}

// Quantiles, linear between neighbours. Sorts `values`.
std::vector<double> quantiles_of(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  std::vector<double> quantiles;
  for (int k = 0; k < kQuantiles; ++k) {
    const double rank = static_cast<double>(values.size() - 1) * k / (kQuantiles - 1);
    const auto below = static_cast<size_t>(rank);
    const size_t above = std::min(below + 1, values.size() - 1);
    quantiles.push_back(std::lerp(values[below], values[above], rank - std::floor(rank)));
  }
  return quantiles;
}

// The value of the same rank in `to`; beyond the ends, at the same distance from them.
double moved(double value, const std::vector<double>& from, const std::vector<double>& to) {
  if (value <= from.front()) return to.front() + value - from.front();
  if (value >= from.back()) return to.back() + value - from.back();
  const auto above = std::upper_bound(from.begin(), from.end(), value);
  const size_t k = above - from.begin();
  return std::lerp(to[k - 1], to[k], (value - from[k - 1]) / (from[k] - from[k - 1]));
}

}  // namespace

absl::StatusOr<HistogramMatch> HistogramMatch::learn(const RadianceImage& source,
                                                     const RadianceImage& target) {
  if (source.empty() || target.empty())
    return absl::InvalidArgumentError("a picture to match colours with is empty");
  const Moments from = moments_of(source), to = moments_of(target);
  const auto root = [](double value) { return std::sqrt(value); };
  const Eigen::Matrix3d spread = of_eigenvalues(from.covariance, root);
  const Eigen::Matrix3d narrow =
      of_eigenvalues(from.covariance, [](double value) { return 1.0 / std::sqrt(value); });
  const Eigen::Matrix3d map = narrow * of_eigenvalues(spread * to.covariance * spread, root) * narrow;
  const Eigen::Matrix3d axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(to.covariance).eigenvectors().transpose();
  HistogramMatch match;
  for (int i = 0; i < 3; ++i) {
    const size_t row = i;
    match.source_mean_[row] = from.mean(i);
    match.target_mean_[row] = to.mean(i);
    for (int c = 0; c < 3; ++c) {
      match.from_source_[row][c] = (axes * map)(i, c);
      match.to_colour_[row][c] = axes(c, i);
    }
  }
  for (int i = 0; i < 3; ++i) {
    const size_t axis = i;
    std::vector<double> ours, theirs;
    for (size_t at = 0; at < source.samples.size(); at += 3)
      ours.push_back(match.along_axes(&source.samples[at])[axis]);
    for (size_t at = 0; at < target.samples.size(); at += 3)
      theirs.push_back((axes * (colour_at(target, at) - to.mean))(i));
    match.source_quantiles_[axis] = quantiles_of(ours);
    match.target_quantiles_[axis] = quantiles_of(theirs);
  }
  return match;
}

HistogramMatch::Colour HistogramMatch::along_axes(const float* samples) const {
  Colour along{};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t c = 0; c < 3; ++c) along[i] += from_source_[i][c] * (samples[c] - source_mean_[c]);
  }
  return along;
}

void HistogramMatch::apply(RadianceImage& picture) const {
  for (size_t at = 0; at < picture.samples.size(); at += 3) {
    Colour along = along_axes(&picture.samples[at]);
    for (size_t i = 0; i < 3; ++i) along[i] = moved(along[i], source_quantiles_[i], target_quantiles_[i]);
    for (size_t c = 0; c < 3; ++c) {
      double light = target_mean_[c];
      for (size_t i = 0; i < 3; ++i) light += to_colour_[c][i] * along[i];
      picture.samples[at + c] = static_cast<float>(std::max(light, 0.0));
    }
  }
}

}  // namespace glasswing
