// Smooth maps of an empty stage, held against the ones they were made from.
#include "solver/background/stage_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth = 320, kHeight = 240;
using Truth = std::function<std::array<double, 2>(double x_px, double y_px)>;

// A camera beside the monitor's axis, turned.
std::array<double, 2> perspective(double x, double y) {
  const double depth = 1.0 + 2e-4 * x - 3e-4 * y;
  return {(1.9 * x - 0.2 * y + 30.0) / depth, (0.25 * x + 1.8 * y - 12.0) / depth};
}

// Through a lens that bends by 3 % in the corners.
std::array<double, 2> distorted(double x, double y) {
  const double u = x / (0.5 * kWidth) - 1.0, v = y / (0.5 * kHeight) - 1.0;
  const double bend = 0.015 * (u * u + v * v);
  return perspective(x + bend * u * 0.5 * kWidth, y + bend * v * 0.5 * kHeight);
}

struct Seen {
  int count = 4000;
  double sd_px = 0.1;
  double wrong = 0.0;  // the share that is anywhere
  std::vector<double> directions_deg{0.0, 90.0, 45.0, -45.0};
  unsigned seed = 1;
};

std::vector<Sighting> sightings_of(const Truth& truth, const Seen& seen) {
  std::mt19937 random(seen.seed);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  std::vector<Sighting> all;
  for (int i = 0; i < seen.count; ++i) {
    const double phi =
        seen.directions_deg[static_cast<size_t>(i) % seen.directions_deg.size()] * std::numbers::pi / 180.0;
    Sighting own{.x_px = uniform(random) * kWidth,
                 .y_px = uniform(random) * kHeight,
                 .cos_phi = std::cos(phi),
                 .sin_phi = std::sin(phi),
                 .position_px = 0.0,
                 .sd_px = seen.sd_px};
    const auto [u, v] = truth(own.x_px, own.y_px);
    own.position_px = own.cos_phi * u + own.sin_phi * v + seen.sd_px * normal(random);
    if (uniform(random) < seen.wrong) own.position_px = 600.0 * uniform(random);
    all.push_back(own);
  }
  return all;
}

// Over the whole picture, corners included.
double rms_px(const StageMap& map, const Truth& truth) {
  double squares = 0.0, count = 0.0;
  for (double y = 0.0; y <= kHeight; y += 8.0) {
    for (double x = 0.0; x <= kWidth; x += 8.0) {
      const StagePoint point = map.at(x, y);
      const auto [u, v] = truth(x, y);
      squares += std::pow(point.x_px - u, 2.0) + std::pow(point.y_px - v, 2.0);
      count += 2.0;
    }
  }
  return std::sqrt(squares / count);
}

StageMap fitted(const Truth& truth, const Seen& seen) {
  const StageMap::Fitted result = StageMap::fit(sightings_of(truth, seen), kWidth, kHeight);
  EXPECT_TRUE(result.map) << result.refused;
  return result.map.value_or(StageMap());
}

TEST(StageMap, AFlatMonitorIsAHomography) {
  const StageMap map = fitted(perspective, {});
  EXPECT_EQ(map.degree(), 0);
  // Eight parameters from 4000 positions of 0.1 px each, 3000 of which tell of one axis: 0.1 sqrt(8 / 4000).
  EXPECT_LT(rms_px(map, perspective), 2.0 * 0.1 * std::sqrt(8.0 / 4000.0));
}

TEST(StageMap, ALensBendsIt) {
  const StageMap map = fitted(distorted, {});
  EXPECT_GE(map.degree(), 3);
  // Corners are known less well than the mean.
  EXPECT_LT(rms_px(map, distorted), 2.5 * 0.1 * std::sqrt(56.0 / 4000.0));
}

TEST(StageMap, WithoutNoiseItIsExact) {
  EXPECT_LT(rms_px(fitted(perspective, {.sd_px = 1e-4}), perspective), 1e-4);
  EXPECT_LT(rms_px(fitted(distorted, {.sd_px = 1e-3}), distorted), 3e-3);
}

TEST(StageMap, AQuarterOfWrongPositionsHardlyMatters) {
  const StageMap map = fitted(distorted, {.wrong = 0.25});
  EXPECT_LT(rms_px(map, distorted), 3.0 * 0.1 * std::sqrt(56.0 / 3000.0));
}

TEST(StageMap, TwoDirectionsAreEnough) {
  EXPECT_LT(rms_px(fitted(perspective, {.directions_deg = {30.0, 100.0}}), perspective), 0.02);
}

TEST(StageMap, KnowsItsOwnError) {
  for (const Truth& truth : {Truth(perspective), Truth(distorted)}) {
    double squares = 0.0, variance = 0.0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
      // Sightings are four times worse than they say; the scatter tells.
      std::vector<Sighting> all = sightings_of(truth, {.count = 2000, .sd_px = 0.4, .seed = seed});
      for (Sighting& own : all) own.sd_px = 0.1;
      const StageMap map = *StageMap::fit(all, kWidth, kHeight).map;
      squares += std::pow(rms_px(map, truth), 2.0);
      for (double y = 0.0; y <= kHeight; y += 48.0) {
        for (double x = 0.0; x <= kWidth; x += 64.0) variance += std::pow(map.sd_px(x, y), 2.0) / 36.0;
      }
    }
    // Twenty draws of at least eight parameters: chi-square of 160 degrees, sd 6 % of the root; robust
    // weights lose 5 % of the information.
    EXPECT_NEAR(std::sqrt(squares / variance), 1.0, 0.3);
  }
}

TEST(StageMap, FootprintsAreMappedSpots) {
  StageMap map = fitted(distorted, {.sd_px = 0.01});
  map.set_spot_px2(0.3);
  constexpr double kStep = 1e-3;
  for (const auto& [x, y] : {std::pair{3.0, 5.0}, {160.0, 100.0}, {310.0, 230.0}}) {
    const StagePoint at = map.at(x, y);
    const StagePoint left = map.at(x - kStep, y), right = map.at(x + kStep, y);
    const StagePoint above = map.at(x, y - kStep), below = map.at(x, y + kStep);
    const double u_x = (right.x_px - left.x_px) / (2.0 * kStep),
                 v_x = (right.y_px - left.y_px) / (2.0 * kStep);
    const double u_y = (below.x_px - above.x_px) / (2.0 * kStep),
                 v_y = (below.y_px - above.y_px) / (2.0 * kStep);
    EXPECT_NEAR(at.xx_px2, 0.3 * (u_x * u_x + u_y * u_y), 1e-6);
    EXPECT_NEAR(at.xy_px2, 0.3 * (u_x * v_x + u_y * v_y), 1e-6);
    EXPECT_NEAR(at.yy_px2, 0.3 * (v_x * v_x + v_y * v_y), 1e-6);
  }
}

TEST(StageMap, SaysWhyThereIsNone) {
  EXPECT_EQ(StageMap::fit(sightings_of(perspective, {.count = 59}), kWidth, kHeight).refused,
            "59 positions were found; at least 60 are needed");
  EXPECT_EQ(StageMap::fit(sightings_of(perspective, {.directions_deg = {0.0}}), kWidth, kHeight).refused,
            "the positions found do not determine a map");
  const StageMap::Fitted torn = StageMap::fit(sightings_of(perspective, {.wrong = 0.5}), kWidth, kHeight);
  EXPECT_FALSE(torn.map);
  EXPECT_TRUE(torn.refused.ends_with(" % of the pixels deviate from it")) << torn.refused;
}

}  // namespace
}  // namespace glasswing
