// The active set against all subsets, one by one, and its statistics against their closed forms.
#include "solver/any/positive_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "core/footprint/pattern_answer.h"

namespace glasswing {
namespace {

constexpr size_t kSamples = 30, kLanes = 32, kColumns = 9;  // F among them
constexpr double kMinGain = 1e-4;                           // of chi2 / 2, that a coefficient is worth having

struct Whole {
  Eigen::MatrixXd a;
  Eigen::VectorXd y, prior, toll;  // prior: 1 / s^2; toll: t |a|
  double half_misfit(const Eigen::VectorXd& x) const {
    return 0.5 * ((y - a * x).squaredNorm() + x.dot(prior.cwiseProduct(x)));
  }
  double half_cost(const Eigen::VectorXd& x) const { return half_misfit(x) + toll.dot(x); }
};

PositiveProblem random_problem(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  PositiveProblem problem{
      .samples = kSamples, .lanes = kLanes, .a = {}, .y = {}, .prior_sd = {}, .toll = 0.3};
  problem.a.resize(kLanes * kColumns);
  problem.y.resize(kLanes);
  std::vector<float> likeness(kSamples);
  for (float& each : likeness) each = normal(random);
  for (size_t k = 0; k < kColumns; ++k) {
    problem.prior_sd.push_back(0.1 + std::abs(static_cast<double>(normal(random))));
    for (size_t i = 0; i < kSamples; ++i)
      problem.a[k * kLanes + i] = 5.0f * (likeness[i] + 0.3f * normal(random));
  }
  for (size_t i = 0; i < kSamples; ++i) problem.y[i] = 10.0f * likeness[i] + 10.0f * normal(random);
  return problem;
}

Whole whole_of(const PositiveProblem& problem) {
  const auto lanes = static_cast<Eigen::Index>(kLanes), columns = static_cast<Eigen::Index>(kColumns);
  Whole whole{.a = Eigen::Map<const Eigen::MatrixXf>(problem.a.data(), lanes, columns).cast<double>(),
              .y = Eigen::Map<const Eigen::VectorXf>(problem.y.data(), lanes).cast<double>(),
              .prior = Eigen::VectorXd(columns),
              .toll = {}};
  for (Eigen::Index k = 0; k < columns; ++k)
    whole.prior[k] = std::pow(problem.prior_sd[static_cast<size_t>(k)], -2);
  whole.toll = problem.toll * whole.a.colwise().norm().transpose();
  whole.toll[0] = 0.0;
  return whole;
}

// The least over those subsets of which no coefficient but F is negative.
Eigen::VectorXd best_of_all(const Whole& whole) {
  Eigen::VectorXd best = Eigen::VectorXd::Zero(whole.a.cols());
  double least = INFINITY;
  for (unsigned subset = 1; subset < 1u << kColumns; subset += 2) {
    std::vector<Eigen::Index> in;
    for (Eigen::Index k = 0; k < whole.a.cols(); ++k) {
      if ((subset >> k & 1u) != 0) in.push_back(k);
    }
    const Eigen::MatrixXd a = whole.a(Eigen::all, in);
    Eigen::MatrixXd g = a.transpose() * a;
    g.diagonal() += whole.prior(in);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(whole.a.cols());
    const Eigen::VectorXd own = g.ldlt().solve(a.transpose() * whole.y - whole.toll(in));
    x(in) = own;
    if (x.tail(x.size() - 1).minCoeff() < 0.0 || !(whole.half_cost(x) < least)) continue;
    least = whole.half_cost(x);
    best = x;
  }
  return best;
}

TEST(PositiveFit, IsTheLeastOfAllSubsets) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const PositiveProblem problem = random_problem(seed);
    const Whole whole = whole_of(problem);
    const Eigen::VectorXd best = best_of_all(whole);
    for (const std::vector<size_t>& start : {std::vector<size_t>{}, {1, 2, 3, 4, 5, 6, 7, 8}, {5}}) {
      const PositiveFit fit = positive_minimum(problem, 1, kColumns, start);
      Eigen::VectorXd x = Eigen::VectorXd::Zero(best.size());
      for (const auto& [column, own] : fit.above) x[static_cast<Eigen::Index>(column)] = own;
      EXPECT_GE(x.tail(x.size() - 1).minCoeff(), 0.0);
      // The cost is convex: it is above the least by no more than its slopes times the way there, and a slope
      // left is worth less than the least gain. Products of floats are known to 1e-6.
      const Eigen::VectorXd square = whole.a.colwise().squaredNorm().transpose() + whole.prior;
      const double more = (2.0 * kMinGain * square.array()).sqrt().matrix().dot(best.cwiseAbs()) +
                          1e-6 * whole.y.squaredNorm();
      EXPECT_LE(whole.half_cost(x), whole.half_cost(best) + more) << seed;
    }
  }
}

TEST(PositiveFit, KnowsItsFreedomAndEvidence) {
  const PositiveProblem problem = random_problem(3);
  const Whole whole = whole_of(problem);
  const PositiveFit fit = positive_minimum(problem, 1, kColumns);
  std::vector<Eigen::Index> in;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(whole.a.cols());
  for (const auto& [column, own] : fit.above) {
    in.push_back(static_cast<Eigen::Index>(column));
    x[in.back()] = own;
  }
  const Eigen::MatrixXd a = whole.a(Eigen::all, in);
  Eigen::MatrixXd g = a.transpose() * a;
  g.diagonal() += whole.prior(in);
  const double freedom = (g.inverse() * a.transpose() * a).trace(),
               evidence = -whole.half_misfit(x) - 0.5 * std::log(g.determinant() / whole.prior(in).prod());
  EXPECT_NEAR(fit.freedom, freedom, 1e-4 * freedom);
  EXPECT_NEAR(fit.evidence, evidence, 1e-4 * std::abs(evidence));
  EXPECT_NEAR(fit.chi2, (whole.y - whole.a * x).squaredNorm(), 1e-4 * fit.chi2);
}

// Those of [1, 4) alone.
TEST(PositiveFit, LeavesOthersOut) {
  for (const auto& [column, x] : positive_minimum(random_problem(4), 1, 4).above) EXPECT_LT(column, 4u);
}

// Far from edges, cut by them, and narrower than a pixel there.
TEST(PatternAnswers, ValuesAreTheFirstColumn) {
  std::vector<ShownPattern> shown(2);
  shown[1].lit.bars = true;
  shown[1].lit.bar_px = 8.0;
  for (const double turn_rad : {0.0, 0.8}) {
    ShownPattern stripe, wave;
    stripe.kind = ShownPattern::Kind::kStripe;
    stripe.axis = {std::cos(turn_rad), std::sin(turn_rad), 3.0};
    for (int i = 0; i < 40; ++i) {
      stripe.r_px = 3.0 * i;
      shown.push_back(stripe);
    }
    wave.kind = ShownPattern::Kind::kWave;
    wave.fx = 0.1;
    wave.fy = 0.1 * turn_rad;
    for (int i = 0; i < 3; ++i) {
      wave.phase_rad = 2.0 * i;
      shown.push_back(wave);
    }
  }
  const PatternAnswers answers(shown, {.width_px = 90.0, .height_px = 60.0});
  const auto count = static_cast<size_t>(answers.size());
  std::vector<double> all(PatternAnswers::kColumns * count), values(count);
  for (const Footprint& mode : {Footprint{0.7, 40, 30, 4, 1, 9},
                                {0.7, 1, 30, 16, 0, 16},
                                {0.7, 88, 58, 9, 2, 5},
                                {0.7, 0.5, 20, 0.1, 0, 0.1}}) {
    answers.of(mode, true, all.data(), static_cast<std::ptrdiff_t>(count));
    answers.values(mode, values.data());
    // exp(-25) of the highest
    for (size_t i = 0; i < count; ++i) EXPECT_NEAR(values[i], all[i], 1e-10) << i;
  }
}

}  // namespace
}  // namespace glasswing
