#include "core/web/web_rays.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/core/web/made_for_web.h"

namespace glasswing {
namespace {

TEST(ViewDeg, IsThatOfAPinhole) {
  EXPECT_NEAR(view_deg(two_rays().metadata.geometry().camera()), 90.0, 1e-9);
}

// A square object in the middle, whose state tells the row's half; one faint ray beside each.
RayMatte an_object(int side) {
  RayMatte rays(side, side, 2);
  for (int y = side / 4; y < 3 * side / 4; ++y) {
    for (int x = side / 4; x < 3 * side / 4; ++x) {
      rays.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        rays.rays(x, y, c)[0].weight = 0.5f;
        rays.rays(x, y, c)[0].origin_mm = {static_cast<float>(x), static_cast<float>(y), 100.0f};
        rays.rays(x, y, c)[0].state = y < side / 2 ? RayState::kMatched : RayState::kUnknown;
        rays.rays(x, y, c)[1].weight = 0.01f;
      }
    }
  }
  rays.rays(0, 0, 1)[0].weight = 1.0f;  // beside the object
  return rays;
}

TEST(SampledRays, AreAllWhereThereAreFew) {
  EXPECT_EQ(sampled_rays(an_object(8), 16).size(), 16u);
  EXPECT_TRUE(sampled_rays(RayMatte(5, 4, 1), 16).empty());
}

TEST(SampledRays, AreEvenlyOverTheObjectWhereThereAreMany) {
  const std::vector<Ray> some = sampled_rays(an_object(80), 200);
  EXPECT_LE(some.size(), 200u);
  EXPECT_GE(some.size(), 50u);  // the next smaller distance would leave at most four times as many
  std::map<RayState, int> states;
  for (const Ray& ray : some) {
    EXPECT_EQ(ray.weight, 0.5f);
    EXPECT_GE(ray.origin_mm.x(), 20.0f);
    ++states[ray.state];
  }
  EXPECT_NEAR(states[RayState::kMatched], states[RayState::kUnknown], 20);
}

}  // namespace
}  // namespace glasswing
