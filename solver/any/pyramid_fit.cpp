#include "solver/any/pyramid_fit.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kReach = 3.0;          // of a footprint: standard deviations beside its mean, and
constexpr double kMargin_px = 2.0;      // this much
constexpr size_t kMostPlaces = 1200;    // that take part; beyond that the narrowest level is left out
constexpr size_t kMostKnown = 20000;    // answers kept
constexpr double kBoundNoise = 4.0;     // standard deviations of a sample by which it bounds a coefficient
constexpr double kLeastAnswer = 0.02;   // of a place's highest answer: samples below bound nothing
constexpr double kLeastOfPrior = 0.02;  // a coefficient that must be smaller is 0
constexpr double kFloorPrior = 1e-6;    // of F, in the least weight of its sum
constexpr int kMostSteps = 60;          // of the minimum
constexpr double kLeastGain = 1e-3;     // of chi2 / 2 by a step that is worth another
constexpr double kLeastShare = 1e-4;    // of a Newton step

// The place and widths of all light.
struct Extent {
  double weight = 0.0, x_px = 0.0, y_px = 0.0, xx_px2 = 0.0, yy_px2 = 0.0;
};

Extent extent_of(const Footprints& modes) {
  Extent all;
  for (const Footprint& mode : modes) {
    all.weight += mode.weight;
    all.x_px += mode.weight * mode.x_px;
    all.y_px += mode.weight * mode.y_px;
  }
  if (!(all.weight > 0.0)) return {};
  all.x_px /= all.weight;
  all.y_px /= all.weight;
  for (const Footprint& mode : modes) {
    all.xx_px2 += mode.weight / all.weight * (mode.xx_px2 + std::pow(mode.x_px - all.x_px, 2));
    all.yy_px2 += mode.weight / all.weight * (mode.yy_px2 + std::pow(mode.y_px - all.y_px, 2));
  }
  return all;
}

struct Range {
  double low_px, high_px;
};

Range reached(double centre_px, double variance_px2, double size_px) {
  const double reach = kReach * std::sqrt(variance_px2) + kMargin_px;
  return {std::max(centre_px - reach, 0.0), std::min(centre_px + reach, size_px)};
}

void add_places(int level, const Range& x, const Range& y, std::vector<Coefficient>& places) {
  const double step = std::ldexp(2.0, level);
  for (int row = static_cast<int>(y.low_px / step); (row + 0.5) * step < y.high_px + 0.5 * step; ++row) {
    for (int column = static_cast<int>(x.low_px / step); (column + 0.5) * step < x.high_px + 0.5 * step;
         ++column)
      places.push_back({.level = level, .column = column, .row = row, .weight = 0.0f});
  }
}

}  // namespace

Eigen::VectorXd positive_minimum(const Eigen::MatrixXd& g, const Eigen::VectorXd& b) {
  const Eigen::Index n = b.size();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n), gx = x;
  const auto cost = [&](const Eigen::VectorXd& at, const Eigen::VectorXd& g_at) {
    return 0.5 * at.dot(g_at) - b.dot(at);
  };
  double now = 0.0;
  for (int step = 0; step < kMostSteps; ++step) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (x[i] > 0.0 || gx[i] < b[i]) free.push_back(i);
    }
    if (free.empty()) break;
    const Eigen::MatrixXd own = g(free, free);
    const Eigen::VectorXd down = (b - gx)(free), newton = own.llt().solve(down);
    double next = now;
    for (double share = 1.0; share > kLeastShare && !(next < now); share *= 0.5) {
      Eigen::VectorXd there = x;
      for (Eigen::Index k = 0; k < std::ssize(free); ++k)
        there[free[k]] = std::max(x[free[k]] + share * newton[k], 0.0);
      const Eigen::VectorXd g_there = g * there;
      next = cost(there, g_there);
      if (!(next < now)) continue;
      x = there;
      gx = g_there;
    }
    const double gained = now - next;
    now = std::min(now, next);
    if (!(gained > kLeastGain)) break;
  }
  return x;
}

const Eigen::VectorXf& PyramidFitter::answer(const Coefficient& place) {
  const std::int64_t key = (std::int64_t{place.level} << 40) + (std::int64_t{place.column} << 20) + place.row;
  const auto [at, is_new] = known_.try_emplace(key);
  if (is_new) {
    const Eigen::Index n = answers_.size();
    Eigen::MatrixXd columns(n, PatternAnswers::kColumns);
    Coefficient whole = place;
    whole.weight = 1.0f;
    answers_.of(footprint_of(mode_of(whole, 0)), true, columns.data(), n);
    at->second = columns.col(0).cast<float>();
  }
  return at->second;
}

std::optional<PyramidFit> PyramidFitter::fit(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                             const Eigen::VectorXd& peak, const Footprints& near) {
  const Extent light = extent_of(near);
  if (!(light.weight > 0.0)) return std::nullopt;
  const Range across = reached(light.x_px, light.xx_px2, answers_.extent().width_px),
              down = reached(light.y_px, light.yy_px2, answers_.extent().height_px);
  const double area_px2 = (across.high_px - across.low_px) * (down.high_px - down.low_px) / (kReach * kReach);
  if (!(area_px2 > 0.0)) return std::nullopt;
  PyramidFit fit;
  fit.prior_sd = 4.0 * light.weight / area_px2;
  if (known_.size() > kMostKnown) known_.clear();

  const Eigen::Index count = y.size(), black = count - 1;
  std::vector<Coefficient> places;
  std::vector<Eigen::VectorXd> columns;
  std::vector<Coefficient> level_places;
  for (int level = kPyramidLevels - 2; level >= 0; --level) {
    level_places.clear();
    add_places(level, across, down, level_places);
    const size_t before = places.size();
    for (const Coefficient& place : level_places) {
      Eigen::VectorXd own = Eigen::VectorXd::Zero(count);
      own.head(black) = answer(place).cast<double>().cwiseProduct(peak.head(black));
      const double least = kLeastAnswer * own.maxCoeff();
      double bound = INFINITY;
      for (Eigen::Index i = 0; i < black && least > 0.0; ++i) {
        if (own[i] > least && weight[i] > 0.0)
          bound = std::min(bound, (y[i] - y[black] + kBoundNoise / std::sqrt(weight[i])) / own[i]);
      }
      if (!(bound > kLeastOfPrior * std::ldexp(fit.prior_sd, 2 * level)) || !(least > 0.0)) continue;
      places.push_back(place);
      columns.push_back(std::move(own));
    }
    if (places.size() <= kMostPlaces) continue;
    places.resize(before);
    columns.resize(before);
    break;
  }
  if (places.empty()) return std::nullopt;

  const Eigen::Index n = std::ssize(places);
  const Eigen::VectorXd root = weight.cwiseSqrt();
  Eigen::MatrixXd answers(count, n);
  for (Eigen::Index k = 0; k < n; ++k) answers.col(k) = root.cwiseProduct(columns[k]);
  // The minimum over F takes its part along `one`.
  const Eigen::VectorXd one = root / std::sqrt(root.squaredNorm() * (1.0 + kFloorPrior));
  const Eigen::VectorXd seen = root.cwiseProduct(y);
  const Eigen::VectorXd rest = seen - one * one.dot(seen);
  answers -= one * (one.transpose() * answers).eval();
  Eigen::MatrixXd g = answers.transpose() * answers;
  for (Eigen::Index k = 0; k < n; ++k) g(k, k) += std::pow(std::ldexp(fit.prior_sd, 2 * places[k].level), -2);
  const Eigen::VectorXd found = positive_minimum(g, answers.transpose() * rest);
  fit.chi2 = (rest - answers * found).squaredNorm();
  Eigen::VectorXd model = Eigen::VectorXd::Zero(count);
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!(found[k] > 0.0)) continue;
    model += found[k] * columns[k];
    places[k].weight = static_cast<float>(found[k]);
    if (places[k].weight > 0.0f) fit.coefficients.push_back(places[k]);
  }
  fit.floor = weight.dot(y - model) / weight.sum();
  return fit;
}

}  // namespace glasswing
