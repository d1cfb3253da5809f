#include "solver/background/stage_map.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kTukey = 4.685;  // standard deviations, 95 % efficient for normal errors
constexpr double kRefuted = 4.0;
constexpr int kStartRounds = 30, kFitRounds = 20;
constexpr double kSmall = 1e-4;         // px, of a change of the map
constexpr double kMinPerUnknown = 6.0;  // sightings

int term_count(int degree) {
  return degree < 2 ? 0 : (degree + 1) * (degree + 2) / 2;
}

// Of a map; the terms up to the first degree repeat a part of the homography.
double unknown_count(int degree) {
  return 8.0 + 2.0 * std::max(term_count(degree) - 3, 0);
}

// T_i(x) T_j(y) for i + j <= degree, and their derivatives.
struct Terms {
  std::array<double, 28> value, by_x, by_y;
};

Terms terms_at(double x, double y, int degree) {
  constexpr size_t kSize = StageMap::kMaxDegree + 1;
  const auto chebyshev = [degree](double t, std::array<double, kSize>& value,
                                  std::array<double, kSize>& slope) {
    value[0] = 1.0, slope[0] = 0.0;
    value[1] = t, slope[1] = 1.0;
    for (size_t i = 2; i <= static_cast<size_t>(degree); ++i) {
      value[i] = 2.0 * t * value[i - 1] - value[i - 2];
      slope[i] = 2.0 * value[i - 1] + 2.0 * t * slope[i - 1] - slope[i - 2];
    }
  };
  std::array<double, kSize> tx, dx, ty, dy;
  chebyshev(x, tx, dx);
  chebyshev(y, ty, dy);
  Terms terms{};
  size_t k = 0;
  for (size_t sum = 0; sum <= static_cast<size_t>(degree); ++sum) {
    for (size_t j = 0; j <= sum; ++j, ++k) {
      const size_t i = sum - j;
      terms.value[k] = tx[i] * ty[j];
      terms.by_x[k] = dx[i] * ty[j];
      terms.by_y[k] = tx[i] * dy[j];
    }
  }
  return terms;
}

template <typename Matrix>
bool determined(const Eigen::LDLT<Matrix>& solver) {
  const auto pivots = solver.vectorD().cwiseAbs();
  return pivots.minCoeff() > 1e-12 * pivots.maxCoeff();
}

}  // namespace

double sd_by_median(std::vector<double>& sizes) {
  constexpr double kMedian = 0.67449;  // of the size of a normal value, in standard deviations
  const auto middle = sizes.begin() + std::ssize(sizes) / 2;
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / kMedian;
}

class StageMapFit {
 public:
  StageMapFit(std::span<const Sighting> sightings, int width_px, int height_px) : sightings_(sightings) {
    start_.width_px_ = width_px;
    start_.height_px_ = height_px;
  }

  StageMap::Fitted run() {
    if (std::ssize(sightings_) < StageMap::kMinSightings)
      return refusal(fmt::format("{} positions were found; at least {} are needed", sightings_.size(),
                                 StageMap::kMinSightings));
    if (!start() || !fit_homography()) return refusal("the positions found do not determine one");
    std::vector<Candidate> all{{.map = start_, .scatter = scatter_of(residuals(start_))}};
    for (int degree = 2; degree <= StageMap::kMaxDegree; ++degree) {
      if (kMinPerUnknown * unknown_count(degree) > static_cast<double>(sightings_.size())) break;
      StageMap map = all.back().map;
      if (!fit_rest(degree, map)) break;
      all.push_back({.map = map, .scatter = scatter_of(residuals(map))});
    }
    // The noise is what the most flexible map leaves.
    const double noise = all.back().scatter;
    return judged(*std::ranges::min_element(all, {}, [&](const Candidate& each) {
      return cost(each.map, noise) + 2.0 * unknown_count(each.map.degree_);
    }));
  }

 private:
  struct Candidate {
    StageMap map;
    double scatter = 1.0;  // of the sightings, in their standard deviations; at least 1
  };

  static StageMap::Fitted refusal(std::string why) {
    return {.map = std::nullopt, .refused = std::move(why)};
  }

  double residual(const StageMap& map, const Sighting& sighting) const {
    const StagePoint point = map.at(sighting.x_px, sighting.y_px);
    return sighting.position_px - sighting.cos_phi * point.x_px - sighting.sin_phi * point.y_px;
  }

  std::vector<double> residuals(const StageMap& map) const {
    std::vector<double> all;
    all.reserve(sightings_.size());
    for (const Sighting& sighting : sightings_) all.push_back(residual(map, sighting) / sighting.sd_px);
    return all;
  }

  static double scatter_of(const std::vector<double>& residuals) {
    std::vector<double> sizes;
    sizes.reserve(residuals.size());
    for (const double each : residuals) sizes.push_back(std::abs(each));
    return std::max(sd_by_median(sizes), 1.0);
  }

  static double biweight(double residual, double scatter) {
    const double z = residual / (kTukey * scatter);
    return std::abs(z) < 1.0 ? (1.0 - z * z) * (1.0 - z * z) : 0.0;
  }

  // Twice Tukey's loss, which is the square of small residuals.
  double cost(const StageMap& map, double scatter) const {
    double sum = 0.0;
    for (const double each : residuals(map)) {
      const double z = std::min(std::abs(each) / (kTukey * scatter), 1.0);
      sum += kTukey * kTukey / 3.0 * (1.0 - std::pow(1.0 - z * z, 3.0));
    }
    return sum;
  }

  // An affine map by least absolute deviations, which half of the sightings being wrong hardly moves.
  bool start() {
    std::vector<double> weights(sightings_.size(), 1.0);
    for (int round = 0; round < kStartRounds; ++round) {
      Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
      for (size_t i = 0; i < sightings_.size(); ++i) {
        const Sighting& own = sightings_[i];
        const auto [x, y] = start_.scaled(own.x_px, own.y_px);
        Eigen::Matrix<double, 6, 1> row;
        row << own.cos_phi * x, own.cos_phi * y, own.cos_phi, own.sin_phi * x, own.sin_phi * y, own.sin_phi;
        row /= own.sd_px;
        normal.noalias() += weights[i] * row * row.transpose();
        right += weights[i] * own.position_px / own.sd_px * row;
      }
      const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(normal);
      const Eigen::Matrix<double, 6, 1> solved = solver.solve(right);
      if (!solved.allFinite() || !determined(solver)) return false;
      std::copy_n(solved.data(), 6, start_.homography_.begin());
      const std::vector<double> left = residuals(start_);
      for (size_t i = 0; i < weights.size(); ++i) weights[i] = 1.0 / std::max(std::abs(left[i]), 0.1);
    }
    return true;
  }

  bool fit_homography() {
    for (int round = 0; round < kFitRounds; ++round) {
      const std::vector<double> left = residuals(start_);
      const double scatter = scatter_of(left);
      Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
      Eigen::Matrix<double, 8, 1> right = Eigen::Matrix<double, 8, 1>::Zero();
      for (size_t i = 0; i < sightings_.size(); ++i) {
        const double weight = biweight(left[i], scatter);
        if (weight == 0.0) continue;
        const Sighting& own = sightings_[i];
        const auto [x, y] = start_.scaled(own.x_px, own.y_px);
        const StagePoint point = start_.at(own.x_px, own.y_px);
        const double depth = 1.0 + start_.homography_[6] * x + start_.homography_[7] * y;
        const double along = own.cos_phi * point.x_px + own.sin_phi * point.y_px;
        Eigen::Matrix<double, 8, 1> row;
        row << own.cos_phi * x, own.cos_phi * y, own.cos_phi, own.sin_phi * x, own.sin_phi * y, own.sin_phi,
            -along * x, -along * y;
        row /= depth * own.sd_px;
        normal.noalias() += weight * row * row.transpose();
        right += weight * left[i] * row;
      }
      const Eigen::LDLT<Eigen::Matrix<double, 8, 8>> solver(normal);
      const Eigen::Matrix<double, 8, 1> step = solver.solve(right);
      if (!step.allFinite() || !determined(solver)) return false;
      for (size_t i = 0; i < 8; ++i) start_.homography_[i] += step[static_cast<Eigen::Index>(i)];
      // The whole picture stays before the camera.
      if (std::abs(start_.homography_[6]) + std::abs(start_.homography_[7]) > 0.95) return false;
      if (step.head<6>().cwiseAbs().maxCoeff() < kSmall) break;
    }
    return true;
  }

  // The rest, by terms up to this degree, beyond the homography. Linear but for the weights.
  bool fit_rest(int degree, StageMap& map) const {
    const Eigen::Index terms = term_count(degree), unknowns = 2 * terms;
    const Eigen::Index known = map.rest_.cols();
    map.degree_ = degree;
    map.rest_.conservativeResize(2, terms);
    map.rest_.rightCols(terms - known).setZero();
    for (int round = 0; round < kFitRounds; ++round) {
      const std::vector<double> left = residuals(map);
      const double scatter = scatter_of(left);
      const auto [normal, right] = equations(map, degree, left, scatter);
      const Eigen::LDLT<Eigen::MatrixXd> solver(normal);  // reads the lower triangle
      const Eigen::VectorXd step = solver.solve(right);
      if (!step.allFinite() || !determined(solver)) return false;
      for (Eigen::Index k = 0; k < unknowns; ++k) map.rest_(k % 2, k / 2) += step[k];
      if (step.cwiseAbs().maxCoeff() < kSmall) break;
    }
    return true;
  }

  // Normal equations of the terms up to `degree`; the lower triangle of the matrix.
  std::pair<Eigen::MatrixXd, Eigen::VectorXd> equations(const StageMap& map, int degree,
                                                        const std::vector<double>& left,
                                                        double scatter) const {
    const Eigen::Index terms = (degree + 1) * (degree + 2) / 2;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(2 * terms, 2 * terms);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(2 * terms), row(2 * terms);
    for (size_t i = 0; i < sightings_.size(); ++i) {
      const double weight = biweight(left[i], scatter);
      if (weight == 0.0) continue;
      const Sighting& own = sightings_[i];
      const auto [x, y] = map.scaled(own.x_px, own.y_px);
      const Terms at = terms_at(x, y, degree);
      for (Eigen::Index k = 0; k < terms; ++k) {
        row[2 * k] = own.cos_phi / own.sd_px * at.value[static_cast<size_t>(k)];
        row[2 * k + 1] = own.sin_phi / own.sd_px * at.value[static_cast<size_t>(k)];
      }
      normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      right += weight * left[i] * row;
    }
    return {std::move(normal), std::move(right)};
  }

  StageMap::Fitted judged(const Candidate& best) const {
    StageMap map = best.map;
    const std::vector<double> left = residuals(map);
    double refuted = 0.0;
    for (const double each : left) refuted += std::abs(each) > kRefuted * best.scatter;
    refuted /= static_cast<double>(left.size());
    if (refuted > StageMap::kMaxRefuted)
      return refusal(fmt::format("{:.0f} % of the pixels lie off it", 100.0 * refuted));
    // The terms up to the first degree stand for the homography, which is nearly linear in its parameters.
    const auto [normal, right] = equations(map, std::max(map.degree_, 1), left, best.scatter);
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    map.covariance_ =
        best.scatter * best.scatter * solver.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
    return {.map = std::move(map), .refused = {}};
  }

  std::span<const Sighting> sightings_;
  StageMap start_;
};

StageMap::Fitted StageMap::fit(std::span<const Sighting> sightings, int width_px, int height_px) {
  return StageMapFit(sightings, width_px, height_px).run();
}

std::array<double, 2> StageMap::scaled(double x_px, double y_px) const {
  return {2.0 * x_px / width_px_ - 1.0, 2.0 * y_px / height_px_ - 1.0};
}

double StageMap::sd_px(double x_px, double y_px) const {
  const auto [x, y] = scaled(x_px, y_px);
  const Terms terms = terms_at(x, y, std::max(degree_, 1));
  double variance = 0.0;
  for (Eigen::Index k = 0; k < covariance_.rows(); ++k) {
    for (Eigen::Index l = k % 2; l < covariance_.cols(); l += 2)
      variance += covariance_(k, l) * terms.value[static_cast<size_t>(k / 2)] *
                  terms.value[static_cast<size_t>(l / 2)];
  }
  return std::sqrt(0.5 * variance);
}

StagePoint StageMap::at(double x_px, double y_px) const {
  const auto [x, y] = scaled(x_px, y_px);
  const auto& h = homography_;
  const double depth = 1.0 + h[6] * x + h[7] * y;
  double u = (h[0] * x + h[1] * y + h[2]) / depth, v = (h[3] * x + h[4] * y + h[5]) / depth;
  double u_x = (h[0] - h[6] * u) / depth, u_y = (h[1] - h[7] * u) / depth;
  double v_x = (h[3] - h[6] * v) / depth, v_y = (h[4] - h[7] * v) / depth;
  if (degree_ > 0) {
    const Terms terms = terms_at(x, y, degree_);
    for (Eigen::Index k = 0; k < rest_.cols(); ++k) {
      const auto t = static_cast<size_t>(k);
      u += rest_(0, k) * terms.value[t];
      v += rest_(1, k) * terms.value[t];
      u_x += rest_(0, k) * terms.by_x[t];
      u_y += rest_(0, k) * terms.by_y[t];
      v_x += rest_(1, k) * terms.by_x[t];
      v_y += rest_(1, k) * terms.by_y[t];
    }
  }
  const double to_x = 2.0 / width_px_, to_y = 2.0 / height_px_;
  u_x *= to_x, v_x *= to_x, u_y *= to_y, v_y *= to_y;
  return {.x_px = u,
          .y_px = v,
          .xx_px2 = spot_px2_ * (u_x * u_x + u_y * u_y),
          .xy_px2 = spot_px2_ * (u_x * v_x + u_y * v_y),
          .yy_px2 = spot_px2_ * (v_x * v_x + v_y * v_y)};
}

}  // namespace glasswing
