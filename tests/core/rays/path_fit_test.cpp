#include "core/rays/path_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace glasswing {
namespace {

using Eigen::Vector2d;

// Of a path whose places are at (40, -30) + A u + curvature |u|^2, over a quarter plane that begins 4 px
// away.
std::vector<PathSample> path(double curvature_per_px) {
  std::vector<PathSample> samples;
  for (int y = 4; y <= 12; ++y) {
    for (int x = 0; x <= 8; ++x) {
      const Vector2d step(x, y);
      const double bent = curvature_per_px * step.squaredNorm();
      samples.push_back({.step = step,
                         .seen = Vector2d(40.0 - 2.0 * x + 0.5 * y + bent, -30.0 + 0.25 * x + 3.0 * y - bent),
                         .weight = std::exp(-step.squaredNorm() / 18.0)});
    }
  }
  return samples;
}

TEST(PathFit, IsExactOnPathsOfItsShape) {
  const PathFit affine = fit_path(path(0.0), PathShape::kAffine, 8.0);
  EXPECT_LT((affine.at_start - Vector2d(40.0, -30.0)).norm(), 0.01);  // the ridge
  EXPECT_LT(affine.rms_px, 0.01);
  const PathFit quadratic = fit_path(path(0.1), PathShape::kQuadratic, 8.0);
  EXPECT_LT((quadratic.at_start - Vector2d(40.0, -30.0)).norm(), 0.05);
}

// Alone it weighs a quarter of all; least squares would put the start at its share of 60 px off and more.
TEST(PathFit, APairOfAnotherPathDoesNotTurnIt) {
  std::vector<PathSample> samples = path(0.0);
  samples.front().seen += Vector2d(-60.0, 60.0);
  const PathFit fit = fit_path(samples, PathShape::kAffine, 8.0);
  EXPECT_LT((fit.at_start - Vector2d(40.0, -30.0)).norm(), 0.05);
  EXPECT_GT(fit.rms_px, 10.0);  // which is not hidden
}

}  // namespace
}  // namespace glasswing
