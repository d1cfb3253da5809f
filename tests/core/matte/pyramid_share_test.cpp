#include "core/matte/pyramid_share.h"

#include <gtest/gtest.h>

#include "core/matte/matte_file.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// Four pixels of the object, each with a light of 0.5 in every channel; one has half of its green light, and
// none of another monitor's, in a pyramid.
Matte four_pixels() {
  Matte matte(0, 0, 5, 1, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(5);
  matte.metadata.set_height_px(1);
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(64);
    monitor.set_height_px(48);
  }
  for (int x = 0; x < 4; ++x) {
    matte.coverage(x, 0) = 1.0f;
    for (int c = 0; c < kChannels; ++c) {
      matte.modes(x, 0, c)[0] = {.weight = 0.25f, .xx_px2 = 1.0f, .yy_px2 = 1.0f};
      matte.modes(x, 0, c)[1] = {.weight = 0.25f, .xx_px2 = 1.0f, .yy_px2 = 1.0f, .texture = 1};
    }
  }
  matte.add_pyramid(2, 0, 1,
                    {.coefficients = {{.level = kPyramidLevels, .weight = 0.05f},
                                      {.level = 0, .column = 1, .row = 1, .weight = 0.2f}}});
  return matte;
}

TEST(PyramidShare, IsOfTheObjectsPixelsAndLight) {
  const Matte matte = four_pixels();
  const PyramidShare share = pyramid_share(matte);
  EXPECT_EQ(share.object, 4);
  EXPECT_EQ(share.pixels, 1);
  EXPECT_NEAR(share.light, 4 * 3 * 0.5, 1e-6);
  EXPECT_NEAR(share.in_pyramids, 0.25, 1e-6);
  const PyramidShare of_file = pyramid_share(encode_matte(matte).value()).value();
  EXPECT_EQ(of_file.pixels, 1);
  EXPECT_NEAR(of_file.in_pyramids, share.in_pyramids, 1e-6);
  EXPECT_EQ(
      lost_text(share, "STMaps"),
      "25.0 % of the object's pixels, with 4.2 % of its light, have footprints of any shape, which STMaps "
      "cannot hold: they show the closest Gaussians");
}

TEST(PyramidShare, DroppedPyramidsAreSaidOnce) {
  Matte matte = four_pixels();
  matte.drop_pyramids();
  ASSERT_EQ(matte.metadata.warnings_size(), 1);
  EXPECT_EQ(matte.metadata.warnings(0).substr(0, 6), "25.0 %");
  matte.drop_pyramids();
  EXPECT_EQ(matte.metadata.warnings_size(), 1);
  EXPECT_EQ(lost_text(pyramid_share(matte), "STMaps"), "");
}

}  // namespace
}  // namespace glasswing
