#include "core/footprint/footprint_cholesky.h"

#include <gtest/gtest.h>

#include <random>

namespace glasswing {
namespace {

// B B' + I of a random B: its condition is far from where rounding would matter.
FootprintMatrix some_positive(int n, std::mt19937& random) {
  std::normal_distribution<double> normal;
  FootprintMatrix b(n, n);
  for (int i = 0; i < n * n; ++i) b.data()[i] = normal(random);
  return b * b.transpose() + FootprintMatrix::Identity(n, n);
}

TEST(FootprintCholesky, SolvesAndInverts) {
  std::mt19937 random(1);
  for (const int n : {6, 12, 18, 24}) {
    const FootprintMatrix a = some_positive(n, random);
    const FootprintCholesky factor(a);
    ASSERT_TRUE(factor.positive());
    const FootprintVector x = FootprintVector::LinSpaced(n, -1.0, 1.0);
    EXPECT_LT((factor.solve(a * x) - x).norm(), 1e-10);
    EXPECT_LT((a * factor.inverse() - FootprintMatrix::Identity(n, n)).norm(), 1e-10);
    EXPECT_EQ(factor.inverse_columns(n - 3).leftCols<3>(), factor.inverse().rightCols<3>());
  }
}

TEST(FootprintCholesky, KnowsWhatIsNotPositive) {
  FootprintMatrix a = FootprintMatrix::Identity(12, 12);
  a(7, 7) = -1.0;
  EXPECT_FALSE(FootprintCholesky(a).positive());
  a(7, 7) = 0.0;
  EXPECT_FALSE(FootprintCholesky(a).positive());
  a(7, 7) = NAN;
  EXPECT_FALSE(FootprintCholesky(a).positive());
}

}  // namespace
}  // namespace glasswing
