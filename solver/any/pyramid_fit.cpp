#include "solver/any/pyramid_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

namespace glasswing {
namespace {

constexpr double kPrior = 8.0;          // of a coefficient, over the density of light
constexpr double kWider = 2.0;          // than the modes in variance: where their light may be, and
constexpr size_t kFewDirections = 4;    // that leave shapes open
constexpr double kBlur_px2 = 4.0;       // of that density
constexpr double kReach = 3.0;          // of a footprint: standard deviations beside its mean, and
constexpr double kMargin_px = 2.0;      // this much
constexpr size_t kMaxPlaces = 2000;     // that take part; beyond that the narrowest level is left out
constexpr size_t kMaxKnown = 20000;     // answers kept
constexpr double kBoundNoise = 4.0;     // standard deviations of a sample by which it bounds a coefficient
constexpr float kMinAnswer = 0.02f;     // of a place's highest answer: samples below bound nothing
constexpr double kMinOfPrior = 0.02;    // of an even prior: a coefficient that must be smaller is 0
constexpr double kMinPrior = 1e-3;      // of an even one: places of less have no light
constexpr float kDark = 1e-4f;          // of the highest answer: samples below tell of F alone
constexpr double kModeFreedom = 5.0;    // of the samples, that a mode takes: its place and widths
constexpr double kTemper = 20.0;        // of log evidence, which neglects that coefficients are positive
constexpr double kMaxDispersion = 1.5;  // chi2 per degree of freedom; beyond it samples are weighed anew,
constexpr int kMaxWeighings = 3;        // so often
constexpr int kMaxRounds = 40;          // of the working set, which
constexpr size_t kMaxAdded = 64;        // grows by so many, and
constexpr int kMaxSteps = 200;          // of its minimum
constexpr double kMinGain = 1e-2;       // of chi2 / 2 by a step, or by a coefficient, that is worth another
constexpr double kMinShare = 0.1;       // of what Newton's step promises, by the projected one
constexpr double kRounding = 1e-9;      // of a step

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

// The density of light at the middle of `place`, blurred by it.
double density(const Footprints& modes, const Footprint& place) {
  double sum = 0.0;
  for (const Footprint& mode : modes) {
    const double xx = mode.xx_px2 + place.xx_px2 + kBlur_px2, yy = mode.yy_px2 + place.yy_px2 + kBlur_px2,
                 xy = mode.xy_px2, determinant = xx * yy - xy * xy, x = place.x_px - mode.x_px,
                 y = place.y_px - mode.y_px;
    sum += mode.weight / (2.0 * std::numbers::pi * std::sqrt(determinant)) *
           std::exp(-0.5 * (x * x * yy - 2.0 * x * y * xy + y * y * xx) / determinant);
  }
  return sum;
}

Footprints widened(Footprints modes) {
  for (Footprint& mode : modes) {
    mode.xx_px2 *= kWider;
    mode.xy_px2 *= kWider;
    mode.yy_px2 *= kWider;
  }
  return modes;
}

// Stripes and waves.
size_t directions_of(const std::vector<ShownPattern>& patterns) {
  std::set<long> found;
  for (const ShownPattern& own : patterns) {
    if (own.kind == ShownPattern::Kind::kArea) continue;
    const bool is_wave = own.kind == ShownPattern::Kind::kWave;
    const double turn_rad =
        is_wave ? std::atan2(own.fy, own.fx) : std::atan2(own.axis.sin_phi, own.axis.cos_phi);
    found.insert(std::lround(180.0 / std::numbers::pi * (turn_rad + 2.0 * std::numbers::pi)) % 180);
  }
  return found.size();
}

PyramidFitter::Range reached(double centre_px, double variance_px2, double size_px) {
  const double reach = kReach * std::sqrt(variance_px2) + kMargin_px;
  return {std::max(centre_px - reach, 0.0), std::min(centre_px + reach, size_px)};
}

void add_places(int level, const PyramidFitter::Range& x, const PyramidFitter::Range& y,
                std::vector<Coefficient>& places) {
  const double step = std::ldexp(2.0, level);
  for (int row = static_cast<int>(y.low_px / step); (row + 0.5) * step < y.high_px + 0.5 * step; ++row) {
    for (int column = static_cast<int>(x.low_px / step); (column + 0.5) * step < x.high_px + 0.5 * step;
         ++column)
      places.push_back({.level = level, .column = column, .row = row, .weight = 0.0f});
  }
}

}  // namespace

namespace {

// The working set: columns, their products, and the coefficients.
class WorkingSet {
 public:
  WorkingSet(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::VectorXd& y,
             const Eigen::Ref<const Eigen::VectorXd>& prior_sd, Eigen::Index left_out)
      : a_(a), y_(y), prior_(prior_sd.array().square().inverse()), is_in_(a.cols(), false) {
    std::fill_n(is_in_.begin() + 1, left_out, true);
  }

  void add(const std::vector<Eigen::Index>& columns) {
    const Eigen::Index before = std::ssize(set_), added = std::ssize(columns), size = before + added;
    set_.insert(set_.end(), columns.begin(), columns.end());
    for (const Eigen::Index k : columns) is_in_[k] = true;
    own_.conservativeResize(a_.rows(), size);
    for (Eigen::Index k = before; k < size; ++k) own_.col(k) = a_.col(set_[k]);
    g_.conservativeResize(size, size);
    g_.bottomRows(added).noalias() = own_.rightCols(added).transpose() * own_;
    g_.topRightCorner(before, added) = g_.bottomLeftCorner(added, before).transpose();
    b_.conservativeResize(size);
    x_.conservativeResize(size);
    for (Eigen::Index k = before; k < size; ++k) {
      g_(k, k) += prior_[set_[k]];
      b_[k] = a_.col(set_[k]).dot(y_);
      x_[k] = 0.0;
    }
  }

  // To the minimum over the set: Newton's steps on those that are free, projected; where that hardly lowers
  // the cost, only as far as the first that becomes 0 (Lawson and Hanson 1974).
  void descend() {
    std::vector<Eigen::Index> free = free_now();
    bool is_all = true;
    for (int step = 0; step < kMaxSteps && !free.empty(); ++step) {
      const Eigen::MatrixXd own = g_(free, free);
      const Eigen::VectorXd down = (b_ - g_ * x_)(free), newton = own.llt().solve(down);
      const double gain = 0.5 * newton.dot(down);
      if (!(gain > kMinGain)) {
        if (is_all) break;
        free = free_now();
        is_all = true;
        continue;
      }
      if (project(free, newton, kMinShare * gain)) {
        free = free_now();
        is_all = true;
        continue;
      }
      double share = 1.0;
      for (Eigen::Index k = 0; k < std::ssize(free); ++k) {
        if (!is_signed(free[k]) && newton[k] < 0.0) share = std::min(share, -x_[free[k]] / newton[k]);
      }
      std::vector<Eigen::Index> left;
      for (Eigen::Index k = 0; k < std::ssize(free); ++k) {
        double& own_x = x_[free[k]];
        own_x += share * newton[k];
        const bool ends = !is_signed(free[k]) && newton[k] < 0.0 && own_x < kRounding * -newton[k];
        if (ends) own_x = 0.0;
        if (!ends) left.push_back(free[k]);
      }
      if (left.size() == free.size()) break;
      free = std::move(left);
      is_all = false;
    }
  }

  // Those outside that would lower the cost, the best first.
  std::vector<Eigen::Index> wanted(const Eigen::VectorXd& square) const {
    const Eigen::VectorXd slope = a_.transpose() * (y_ - own_ * x_);
    std::vector<std::pair<double, Eigen::Index>> gains;
    for (Eigen::Index k = 0; k < a_.cols(); ++k) {
      if (is_in_[k] || !(slope[k] > 0.0)) continue;
      const double gain = 0.5 * slope[k] * slope[k] / (square[k] + prior_[k]);
      if (gain > kMinGain) gains.emplace_back(-gain, k);
    }
    const auto most = std::min(gains.size(), kMaxAdded);
    std::ranges::partial_sort(gains, gains.begin() + static_cast<std::ptrdiff_t>(most));
    std::vector<Eigen::Index> best;
    for (size_t i = 0; i < most; ++i) best.push_back(gains[i].second);
    return best;
  }

  PositiveFit found() const {
    PositiveFit fit{.x = Eigen::VectorXd::Zero(a_.cols())};
    std::vector<Eigen::Index> above;
    double prior = 0.0;
    for (Eigen::Index k = 0; k < x_.size(); ++k) {
      fit.x[set_[k]] = x_[k];
      if (!is_signed(k) && !(x_[k] > 0.0)) continue;
      above.push_back(k);
      prior += x_[k] * x_[k] * prior_[set_[k]] - std::log(prior_[set_[k]]);
    }
    const Eigen::MatrixXd own = g_(above, above);
    const Eigen::LLT<Eigen::MatrixXd> factor(own);
    fit.evidence =
        -0.5 * ((y_ - own_ * x_).squaredNorm() + prior) - factor.matrixLLT().diagonal().array().log().sum();
    const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(own.rows(), own.cols()));
    for (Eigen::Index i = 0; i < std::ssize(above); ++i)
      fit.freedom += 1.0 - prior_[set_[above[i]]] * covariance(i, i);
    return fit;
  }

 private:
  bool is_signed(Eigen::Index k) const { return set_[k] == 0; }
  std::vector<Eigen::Index> free_now() const {
    const Eigen::VectorXd down = b_ - g_ * x_;
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < x_.size(); ++k) {
      if (is_signed(k) || x_[k] > 0.0 || down[k] > 0.0) free.push_back(k);
    }
    return free;
  }
  bool project(const std::vector<Eigen::Index>& free, const Eigen::VectorXd& newton, double least_gain) {
    const double now = cost(x_);
    for (const double share : {1.0, 0.5, 0.25}) {
      Eigen::VectorXd there = x_;
      for (Eigen::Index k = 0; k < std::ssize(free); ++k) {
        double& own_x = there[free[k]];
        own_x += share * newton[k];
        if (!is_signed(free[k])) own_x = std::max(own_x, 0.0);
      }
      if (!(now - cost(there) > least_gain)) continue;
      x_ = there;
      return true;
    }
    return false;
  }
  double cost(const Eigen::VectorXd& x) const { return 0.5 * x.dot(g_ * x) - b_.dot(x); }

  const Eigen::Ref<const Eigen::MatrixXd> a_;
  const Eigen::VectorXd& y_;
  const Eigen::VectorXd prior_;
  std::vector<bool> is_in_;
  std::vector<Eigen::Index> set_;
  Eigen::MatrixXd own_, g_;
  Eigen::VectorXd b_, x_;
};

}  // namespace

PositiveFit positive_minimum(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::VectorXd& y,
                             const Eigen::Ref<const Eigen::VectorXd>& prior_sd, Eigen::Index left_out) {
  WorkingSet set(a, y, prior_sd, left_out);
  const Eigen::VectorXd square = a.colwise().squaredNorm();
  set.add({0});
  set.descend();
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<Eigen::Index> wanted = set.wanted(square);
    if (wanted.empty()) break;
    set.add(wanted);
    set.descend();
  }
  return set.found();
}

PyramidFitter::PyramidFitter(const PatternAnswers& answers)
    : answers_(answers), few_directions_(directions_of(answers.patterns()) <= kFewDirections) {}

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

std::vector<PyramidFitter::Place> PyramidFitter::places_of(const Eigen::VectorXd& y,
                                                           const Eigen::VectorXd& weight,
                                                           const Eigen::VectorXd& peak,
                                                           const Footprints& near, const Range& across,
                                                           const Range& down, double prior_sd) {
  const Footprints expected = widened(near);
  const Eigen::Index black = y.size() - 1;
  const Eigen::ArrayXf most =
      (y.head(black).array() - y[black] + kBoundNoise * weight.head(black).array().rsqrt()).cast<float>();
  const Eigen::ArrayXf peaks =
      (weight.head(black).array() > 0.0).select(peak.head(black).array(), 0.0).cast<float>();
  std::vector<Place> places;
  std::vector<Coefficient> own;
  Eigen::ArrayXf light;
  for (int level = kPyramidLevels - 2; level >= 0; --level) {
    own.clear();
    add_places(level, across, down, own);
    const size_t before = places.size();
    const double even_sd = std::ldexp(prior_sd, 2 * level);
    const auto min_sd = static_cast<float>(kMinOfPrior * even_sd);
    for (const Coefficient& place : own) {
      const double own_sd =
          few_directions_
              ? even_sd
              : std::ldexp(kPrior * density(expected, footprint_of(mode_of(place, 0))), 2 * level);
      if (own_sd < kMinPrior * even_sd) continue;
      light = answer(place).array() * peaks;
      const float least = kMinAnswer * light.maxCoeff();
      if (!(least > 0.0f)) continue;
      if ((light > least && most < min_sd * light).any()) continue;
      places.push_back({place, own_sd});
    }
    if (places.size() <= kMaxPlaces) continue;
    places.resize(before);
    break;
  }
  return places;
}

// The samples that see the places, whitened; those that see none of them tell about F alone, and are the
// last. Columns: F, modes, places.
struct PyramidFitter::Problem {
  Eigen::MatrixXd a;
  Eigen::VectorXd y, prior_sd;
  Eigen::Index modes = 0;
  double chi2_apart = 0.0;  // of what any fit leaves
};

PyramidFitter::Problem PyramidFitter::problem_of(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                                 const Eigen::VectorXd& peak, const Footprints& near,
                                                 const std::vector<Place>& places) {
  const Eigen::Index black = y.size() - 1, first = 1 + near.size();
  Eigen::ArrayXf most = Eigen::ArrayXf::Zero(black);
  for (const Place& place : places) most = most.max(answer(place.at).array());
  const float least = kDark * most.maxCoeff();
  std::vector<Eigen::Index> seeing;
  double dark_weight = 0.0, dark = 0.0, dark_square = 0.0;
  for (Eigen::Index i = 0; i <= black; ++i) {
    if (!(weight[i] > 0.0)) continue;
    if (i < black && most[i] > least) {
      seeing.push_back(i);
    } else {
      dark_weight += weight[i];
      dark += weight[i] * y[i];
      dark_square += weight[i] * y[i] * y[i];
    }
  }
  const Eigen::Index rows = std::ssize(seeing);
  Problem own{.a = Eigen::MatrixXd::Zero(rows + 1, first + std::ssize(places)),
              .y = Eigen::VectorXd::Zero(rows + 1),
              .prior_sd = Eigen::VectorXd::Ones(first + std::ssize(places)),
              .modes = near.size()};
  own.a(rows, 0) = std::sqrt(dark_weight);
  if (dark_weight > 0.0) {
    own.y[rows] = dark / own.a(rows, 0);
    own.chi2_apart = dark_square - own.y[rows] * own.y[rows];
  }
  Eigen::MatrixXd of_modes(black, near.size()), columns(black, PatternAnswers::kColumns);
  for (int m = 0; m < near.size(); ++m) {
    answers_.of(near[m], true, columns.data(), black);
    of_modes.col(m) = columns.col(0);
  }
  Eigen::VectorXd lit(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Eigen::Index sample = seeing[i];
    const double root = std::sqrt(weight[sample]);
    lit[i] = root * peak[sample];
    own.a(i, 0) = root;
    own.y[i] = root * y[sample];
    for (int m = 0; m < near.size(); ++m) own.a(i, 1 + m) = lit[i] * of_modes(sample, m);
  }
  for (Eigen::Index k = 0; k < std::ssize(places); ++k) {
    const Eigen::VectorXf& light = answer(places[k].at);
    for (Eigen::Index i = 0; i < rows; ++i)
      own.a(i, first + k) = lit[i] * static_cast<double>(light[seeing[i]]);
    own.prior_sd[first + k] = places[k].prior_sd;
  }
  return own;
}

struct PyramidFitter::Average {
  Average(const Problem& problem, bool few_directions) : modes(problem.modes) {
    Eigen::MatrixXd a = problem.a;
    Eigen::VectorXd y = problem.y;
    fit(problem, a, y);
    for (int i = 0; i < kMaxWeighings && !explains(problem); ++i) {
      const Eigen::ArrayXd off = (problem.y - problem.a * alone.x).array().square(),
                           modes_off = (problem.y - problem.a * gaussians).array().square();
      // Of noise with Cauchy's tails.
      const Eigen::VectorXd root = (2.0 / (1.0 + off.max(modes_off))).min(1.0).sqrt();
      a = root.asDiagonal() * problem.a;
      y = root.asDiagonal() * problem.y;
      fit(problem, a, y);
    }
    share = by_prediction(a, y);
    if (few_directions) share = std::min(share, by_evidence(y.size()));
  }

  Eigen::VectorXd x() const { return (1.0 - share) * alone.x + share * gaussians; }

  PositiveFit alone;
  Eigen::VectorXd gaussians;
  double share = 0.0;  // of the Gaussians

 private:
  // Samples leave open which of the two is right; the one that fits fewer values to them is likelier. Each
  // mode's place and widths were found from the same samples.
  double by_evidence(Eigen::Index samples) const {
    const double found =
        0.5 * kModeFreedom * static_cast<double>(modes) * std::log(static_cast<double>(samples));
    return 1.0 / (1.0 + std::exp((alone.evidence - gaussians_evidence + found) / kTemper));
  }

  double by_prediction(const Eigen::MatrixXd& a, const Eigen::VectorXd& y) const {
    const Eigen::VectorXd rest = y - a * alone.x, differ = a * (alone.x - gaussians);
    const double more = alone.freedom - 1.0 - kModeFreedom * static_cast<double>(modes),
                 noise = rest.squaredNorm() / (static_cast<double>(y.size()) - alone.freedom);
    return std::clamp((noise * more - rest.dot(differ)) / std::max(differ.squaredNorm(), kRounding), 0.0,
                      1.0);
  }

  void fit(const Problem& problem, const Eigen::MatrixXd& a, const Eigen::VectorXd& y) {
    alone = positive_minimum(a, y, problem.prior_sd, modes);
    const PositiveFit own = positive_minimum(a.leftCols(1 + modes), y, problem.prior_sd.head(1 + modes));
    gaussians = Eigen::VectorXd::Zero(a.cols());
    gaussians.head(1 + modes) = own.x;
    gaussians_evidence = own.evidence;
  }

  bool explains(const Problem& problem) const {
    return (problem.y - problem.a * alone.x).squaredNorm() <
           kMaxDispersion * (static_cast<double>(problem.y.size()) - alone.freedom);
  }

  Eigen::Index modes;
  double gaussians_evidence = 0.0;
};

std::optional<PyramidFit> PyramidFitter::fit(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                             const Eigen::VectorXd& peak, const Footprints& near) {
  const Extent light = extent_of(near);
  if (!(light.weight > 0.0)) return std::nullopt;
  const Range across = reached(light.x_px, light.xx_px2, answers_.extent().width_px),
              down = reached(light.y_px, light.yy_px2, answers_.extent().height_px);
  const double area_px2 = (across.high_px - across.low_px) * (down.high_px - down.low_px) / (kReach * kReach);
  if (!(area_px2 > 0.0)) return std::nullopt;
  const double prior_sd = kPrior * light.weight / area_px2;
  if (known_.size() > kMaxKnown) known_.clear();
  const std::vector<Place> places = places_of(y, weight, peak, near, across, down, prior_sd);
  if (places.empty()) return std::nullopt;
  const Problem all = problem_of(y, weight, peak, near, places);
  const Eigen::Index modes = near.size();
  const Average average(all, few_directions_);
  const Eigen::VectorXd x = average.x();
  PyramidFit fit;
  fit.prior_sd = prior_sd;
  fit.floor = x[0];
  fit.chi2 = (all.y - all.a * x).squaredNorm() + all.chi2_apart;
  fit.gaussian = average.share;
  for (Eigen::Index m = 0; m < modes; ++m) fit.modes.push_back(x[1 + m]);
  for (Eigen::Index k = 0; k < std::ssize(places); ++k) {
    Coefficient own = places[k].at;
    own.weight = static_cast<float>(x[1 + modes + k]);
    if (own.weight > 0.0f) fit.coefficients.push_back(own);
  }
  return fit;
}

}  // namespace glasswing
