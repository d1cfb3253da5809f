// The growing factor against Eigen's of the whole matrix; the set's minimum against its conditions.
#include "core/footprint/positive_set.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace glasswing {
namespace {

constexpr Eigen::Index kSize = 12;
constexpr double kRounding = 1e-9;  // of numbers about 1, by a matrix of condition below 1e4

struct Equations {
  Eigen::MatrixXd n;
  Eigen::VectorXd b;
};

Equations random_equations(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(2 * kSize, kSize, [&] { return normal(random); });
  return {.n = a.transpose() * a, .b = Eigen::VectorXd::NullaryExpr(kSize, [&] { return normal(random); })};
}

std::vector<double> row_of(const Eigen::MatrixXd& n, Eigen::Index k,
                           const std::vector<Eigen::Index>& before) {
  std::vector<double> row;
  for (const Eigen::Index other : before) row.push_back(n(k, other));
  row.push_back(n(k, k));
  return row;
}

TEST(GrowingFactor, SolvesWhatIsLeft) {
  const auto [n, b] = random_equations(1);
  GrowingFactor factor;
  std::vector<Eigen::Index> in;
  for (Eigen::Index k = 0; k < kSize; ++k) {
    ASSERT_TRUE(factor.append(row_of(n, k, in), b[k]));
    in.push_back(k);
  }
  for (const size_t gone : {7, 0, 3}) {
    factor.remove(gone);
    in.erase(in.begin() + static_cast<std::ptrdiff_t>(gone));
  }
  const Eigen::VectorXd other = random_equations(2).b;
  std::vector<double> right;
  for (const Eigen::Index k : in) right.push_back(other[k]);
  for (const Eigen::VectorXd& of : {b, other}) {
    const Eigen::VectorXd expected = n(in, in).ldlt().solve(of(in));
    const std::vector<double> found = factor.solution();
    for (size_t i = 0; i < in.size(); ++i)
      EXPECT_NEAR(found[i], expected[static_cast<Eigen::Index>(i)], kRounding);
    factor.set_right(right);
  }
  EXPECT_FALSE(factor.append(row_of(n, in[2], in), b[in[2]]));  // a column twice
}

// Slopes of those above 0 vanish, and all but the first are above 0.
TEST(PositiveSet, SettlesAtTheMinimum) {
  int fallen = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto [n, b] = random_equations(seed);
    PositiveSet above(kSize);
    std::vector<Eigen::Index> in;
    for (Eigen::Index k = 0; k < kSize; ++k) {
      above.enter(static_cast<size_t>(k), row_of(n, k, in), b[k]);
      in.push_back(k);
    }
    above.settle();
    Eigen::VectorXd x = Eigen::VectorXd::Zero(kSize);
    for (size_t i = 0; i < above.x().size(); ++i) {
      x[static_cast<Eigen::Index>(above.columns()[i])] = above.x()[i];
      if (i > 0) {
        EXPECT_GT(above.x()[i], 0.0);
      }
    }
    const Eigen::VectorXd slope = n * x - b;
    for (const size_t k : above.columns()) EXPECT_NEAR(slope[static_cast<Eigen::Index>(k)], 0.0, kRounding);
    for (Eigen::Index k = 0; k < kSize; ++k) fallen += !above.is_in(static_cast<size_t>(k));
  }
  EXPECT_GT(fallen, 0);
}

// Neighbours that samples hardly tell apart, as a pyramid's: each row of the matrix is a blurred look at all.
// Slopes of those at 0 gain less than 1e-4.
TEST(PositiveMinimum, IsFoundOfMuchAlikeCoefficients) {
  constexpr Eigen::Index kAlike = 120;
  constexpr double kBlur = 6.0, kRidge = 0.01;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd a = Eigen::MatrixXd::NullaryExpr(kAlike, kAlike, [](Eigen::Index i, Eigen::Index k) {
    return k == 0 ? 1.0 : 10.0 * std::exp(-0.5 * std::pow(static_cast<double>(i - k) / kBlur, 2));
  });
  Eigen::MatrixXd n = a.transpose() * a;
  n.diagonal().array() += kRidge;
  for (int draw = 0; draw < 20; ++draw) {
    const Eigen::VectorXd b =
        a.transpose() * Eigen::VectorXd::NullaryExpr(kAlike, [&] { return 3.0 + normal(random); });
    PositiveSet start(kAlike);
    start.enter(n, b, 0);
    const Eigen::VectorXd x = positive_minimum(n, b, start), slope = b - n * x;
    for (Eigen::Index k = 1; k < kAlike; ++k) {
      EXPECT_GE(x[k], 0.0);
      if (x[k] > 0.0) {
        EXPECT_NEAR(slope[k], 0.0, 1e-6 * b.norm());
      } else {
        EXPECT_LE(0.5 * std::pow(std::max(slope[k], 0.0), 2) / n(k, k), 1e-4);
      }
    }
  }
}

}  // namespace
}  // namespace glasswing
