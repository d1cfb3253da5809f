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

constexpr size_t kMaxTerms = (StageMap::kMaxDegree + 1) * (StageMap::kMaxDegree + 2) / 2;

int term_count(int degree) {
  return degree < 2 ? 0 : (degree + 1) * (degree + 2) / 2;
}

// Of a map; the terms up to the first degree repeat a part of the homography.
double unknown_count(int degree) {
  return 8.0 + 2.0 * std::max(term_count(degree) - 3, 0);
}

// T_i(x) T_j(y) for i + j <= degree, and their derivatives.
struct Terms {
  std::array<double, kMaxTerms> value, by_x, by_y;
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
    for (size_t i = 0; i < sightings.size(); ++i) {
      const Sighting& own = sightings[i];
      const bool same = i > 0 && own.x_px == sightings[i - 1].x_px && own.y_px == sightings[i - 1].y_px;
      if (!same) {
        const auto [x, y] = start_.scaled(own.x_px, own.y_px);
        pixels_.push_back({.x = x, .y = y, .first = i, .terms = terms_at(x, y, StageMap::kMaxDegree).value});
      }
      pixels_.back().last = i + 1;
    }
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

  // The sightings [first, last) of one pixel, at its scaled coordinates.
  struct Pixel {
    double x = 0.0, y = 0.0;
    size_t first = 0, last = 0;
    std::array<double, kMaxTerms> terms{};
  };
  // What they weigh and miss by along u and v: sums of w (c, s)(c, s)' and of w (c, s) times the residual.
  struct Pull {
    double uu = 0.0, uv = 0.0, vv = 0.0, u = 0.0, v = 0.0;
  };
  template <typename Weight>
  Pull pull_of(const Pixel& pixel, const std::vector<double>& left, const Weight& weight) const {
    Pull pull;
    for (size_t i = pixel.first; i < pixel.last; ++i) {
      const Sighting& own = sightings_[i];
      const double c = own.cos_phi / own.sd_px, s = own.sin_phi / own.sd_px, w = weight(i);
      pull.uu += w * c * c;
      pull.uv += w * c * s;
      pull.vv += w * s * s;
      pull.u += w * c * left[i];
      pull.v += w * s * left[i];
    }
    return pull;
  }

  // In units of the sightings' standard deviations.
  std::vector<double> residuals(const StageMap& map) const {
    std::vector<double> all;
    all.reserve(sightings_.size());
    for (const Pixel& pixel : pixels_) {
      const auto [u, v] = map.place(pixel.x, pixel.y, pixel.terms);
      for (size_t i = pixel.first; i < pixel.last; ++i) {
        const Sighting& own = sightings_[i];
        all.push_back((own.position_px - own.cos_phi * u - own.sin_phi * v) / own.sd_px);
      }
    }
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
    std::vector<double> left = residuals(start_);  // of a map to 0
    for (int round = 0; round < kStartRounds; ++round) {
      using Matrix6 = Eigen::Matrix<double, 6, 6>;
      using Vector6 = Eigen::Matrix<double, 6, 1>;
      Matrix6 normal = Matrix6::Zero();
      Vector6 right = Vector6::Zero();
      for (const Pixel& pixel : pixels_) {
        const Pull pull = pull_of(
            pixel, left, [&](size_t i) { return round == 0 ? 1.0 : 1.0 / std::max(std::abs(left[i]), 0.1); });
        const Eigen::Vector3d at(pixel.x, pixel.y, 1.0);
        const Eigen::Matrix3d square = at * at.transpose();
        normal.topLeftCorner<3, 3>() += pull.uu * square;
        normal.topRightCorner<3, 3>() += pull.uv * square;
        normal.bottomRightCorner<3, 3>() += pull.vv * square;
        right.head<3>() += pull.u * at;
        right.tail<3>() += pull.v * at;
      }
      normal.bottomLeftCorner<3, 3>() = normal.topRightCorner<3, 3>();
      const Eigen::LDLT<Matrix6> solver(normal);
      const Vector6 step = solver.solve(right);
      if (!step.allFinite() || !determined(solver)) return false;
      for (size_t i = 0; i < 6; ++i) start_.homography_[i] += step[i];
      if (step.cwiseAbs().maxCoeff() < kSmall) break;
      left = residuals(start_);
    }
    return true;
  }

  bool fit_homography() {
    for (int round = 0; round < kFitRounds; ++round) {
      const std::vector<double> left = residuals(start_);
      const double scatter = scatter_of(left);
      using Vector8 = Eigen::Matrix<double, 8, 1>;
      Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
      Vector8 right = Vector8::Zero();
      for (const Pixel& pixel : pixels_) {
        const Pull pull = pull_of(pixel, left, [&](size_t i) { return biweight(left[i], scatter); });
        const auto [u, v] = start_.place(pixel.x, pixel.y, pixel.terms);
        const double x = pixel.x, y = pixel.y,
                     depth = 1.0 + start_.homography_[6] * x + start_.homography_[7] * y;
        Vector8 by_u, by_v;
        by_u << x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y;
        by_v << 0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y;
        by_u /= depth;
        by_v /= depth;
        normal.noalias() += (pull.uu * by_u + pull.uv * by_v) * by_u.transpose();
        normal.noalias() += (pull.uv * by_u + pull.vv * by_v) * by_v.transpose();
        right += pull.u * by_u + pull.v * by_v;
      }
      const Eigen::LDLT<Eigen::Matrix<double, 8, 8>> solver(normal);
      const Vector8 step = solver.solve(right);
      if (!step.allFinite() || !determined(solver)) return false;
      for (size_t i = 0; i < 8; ++i) start_.homography_[i] += step[i];
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
      const auto [normal, right] = equations(degree, left, scatter);
      const Eigen::LDLT<Eigen::MatrixXd> solver(normal);  // reads the lower triangle
      const Eigen::VectorXd step = solver.solve(right);
      if (!step.allFinite() || !determined(solver)) return false;
      for (Eigen::Index k = 0; k < unknowns; ++k) map.rest_(k % 2, k / 2) += step[k];
      if (step.cwiseAbs().maxCoeff() < kSmall) break;
    }
    return true;
  }

  // Normal equations of the terms up to `degree`; the lower triangle of the matrix. Products of Chebyshev
  // polynomials are sums of two, 2 T_i T_k = T_(i+k) + T_|i-k|, so sums of single ones over the pixels
  // suffice.
  std::pair<Eigen::MatrixXd, Eigen::VectorXd> equations(int degree, const std::vector<double>& left,
                                                        double scatter) const {
    constexpr Eigen::Index kSize = 2 * StageMap::kMaxDegree + 1;
    const Eigen::Index terms = (degree + 1) * (degree + 2) / 2, size = 2 * degree + 1;
    Eigen::Matrix<double, kSize, kSize> uu, uv, vv;
    for (auto* const sum : {&uu, &uv, &vv}) sum->setZero();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(2 * terms, 2 * terms);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(2 * terms);
    for (const Pixel& pixel : pixels_) {
      const Pull pull = pull_of(pixel, left, [&](size_t i) { return biweight(left[i], scatter); });
      std::array<double, kSize> tx, ty;
      tx[0] = ty[0] = 1.0;
      tx[1] = pixel.x, ty[1] = pixel.y;
      for (size_t i = 2; i < static_cast<size_t>(size); ++i) {
        tx[i] = 2.0 * pixel.x * tx[i - 1] - tx[i - 2];
        ty[i] = 2.0 * pixel.y * ty[i - 1] - ty[i - 2];
      }
      for (Eigen::Index i = 0; i < size; ++i) {
        for (Eigen::Index j = 0; i + j < size; ++j) {
          const double both = tx[i] * ty[j];
          uu(j, i) += pull.uu * both;
          uv(j, i) += pull.uv * both;
          vv(j, i) += pull.vv * both;
        }
      }
      for (Eigen::Index k = 0; k < terms; ++k) {
        right[2 * k] += pull.u * pixel.terms[k];
        right[2 * k + 1] += pull.v * pixel.terms[k];
      }
    }
    // Of term k: T_i(x) T_j(y).
    std::vector<std::array<Eigen::Index, 2>> powers;
    for (Eigen::Index sum = 0; sum <= degree; ++sum) {
      for (Eigen::Index j = 0; j <= sum; ++j) powers.push_back({sum - j, j});
    }
    for (Eigen::Index k = 0; k < terms; ++k) {
      for (Eigen::Index l = 0; l <= k; ++l) {
        const auto [i, j] = powers[k];
        const auto [m, n] = powers[l];
        const auto product = [i = i, j = j, m = m, n = n](const auto& sums) {
          return 0.25 * (sums(j + n, i + m) + sums(j + n, std::abs(i - m)) + sums(std::abs(j - n), i + m) +
                         sums(std::abs(j - n), std::abs(i - m)));
        };
        normal(2 * k, 2 * l) = product(uu);
        normal(2 * k + 1, 2 * l) = normal(2 * k, 2 * l + 1) = product(uv);
        normal(2 * k + 1, 2 * l + 1) = product(vv);
      }
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
    const auto [normal, right] = equations(std::max(map.degree_, 1), left, best.scatter);
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    map.covariance_ =
        best.scatter * best.scatter * solver.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
    return {.map = std::move(map), .refused = {}};
  }

  std::span<const Sighting> sightings_;
  std::vector<Pixel> pixels_;
  StageMap start_;
};

StageMap::Fitted StageMap::fit(std::span<const Sighting> sightings, int width_px, int height_px) {
  return StageMapFit(sightings, width_px, height_px).run();
}

std::array<double, 2> StageMap::scaled(double x_px, double y_px) const {
  return {2.0 * x_px / width_px_ - 1.0, 2.0 * y_px / height_px_ - 1.0};
}

std::array<double, 2> StageMap::place(double x, double y, std::span<const double> terms) const {
  const auto& h = homography_;
  const double depth = 1.0 + h[6] * x + h[7] * y;
  double u = (h[0] * x + h[1] * y + h[2]) / depth, v = (h[3] * x + h[4] * y + h[5]) / depth;
  for (Eigen::Index k = 0; k < rest_.cols(); ++k) {
    u += rest_(0, k) * terms[k];
    v += rest_(1, k) * terms[k];
  }
  return {u, v};
}

double StageMap::sd_px(double x_px, double y_px) const {
  const auto [x, y] = scaled(x_px, y_px);
  const Terms terms = terms_at(x, y, std::max(degree_, 1));
  double variance = 0.0;
  for (Eigen::Index k = 0; k < covariance_.rows(); ++k) {
    for (Eigen::Index l = k % 2; l < covariance_.cols(); l += 2)
      variance += covariance_(k, l) * terms.value[k / 2] * terms.value[l / 2];
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
      const size_t t = k;
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
