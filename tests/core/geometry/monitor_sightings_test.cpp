// What of a matte says where pixels look.
#include "core/geometry/monitor_sightings.h"

#include <gmock/gmock.h>

#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 40, kHeight = 30;

// Two monitors of 100x80 px: the left half of the picture looks at the first, the right half at the second.
Matte made(bool bare) {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("tilt");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  for (const char* name : {"back", "side"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(100);
    monitor.set_height_px(80);
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = bare ? 0.0f : 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.7f,
                                   .x_px = 10.0f + 1.9f * static_cast<float>(x),
                                   .y_px = 12.0f + 1.8f * static_cast<float>(y),
                                   .xx_px2 = 0.3f,
                                   .yy_px2 = 0.3f,
                                   .texture = x < kWidth / 2 ? 0 : 1,
                                   .centre_sd_px = bare ? 0.0f : 0.25f};
      }
    }
  }
  return matte;
}
absl::StatusOr<StageView> view_of(const Matte& matte) {
  return sightings_in(encode_matte(matte).value());
}

TEST(MonitorSightings, AreWherePixelsLook) {
  for (const bool bare : {true, false}) {
    const StageView view = view_of(made(bare)).value();
    EXPECT_EQ(view.width_px, kWidth);
    EXPECT_EQ(view.height_px, kHeight);
    ASSERT_EQ(view.monitors.size(), 2u);
    for (size_t m = 0; m < 2; ++m) {
      const MonitorView& own = view.monitors[m];
      EXPECT_EQ(own.session, "tilt");
      EXPECT_EQ(own.monitor, m == 0 ? "back" : "side");
      EXPECT_EQ(own.width_px, 100);
      EXPECT_EQ(own.height_px, 80);
      EXPECT_EQ(own.sightings.size(), static_cast<size_t>(kWidth / 2 * kHeight));
      for (const Sighting& sighting : own.sightings) {
        EXPECT_EQ(sighting.pixel.x() < kWidth / 2, m == 0);
        EXPECT_NEAR(sighting.monitor_px.x(), 10.0 + 1.9 * (sighting.pixel.x() - 0.5), 1e-4);
        EXPECT_NEAR(sighting.monitor_px.y(), 12.0 + 1.8 * (sighting.pixel.y() - 0.5), 1e-4);
        EXPECT_EQ(sighting.sd_px, bare ? 0.0 : 0.25);
      }
    }
  }
}

TEST(MonitorSightings, LeaveOutObjectsEdgesAndMixtures) {
  Matte matte = made(true);
  matte.coverage(3, 4) = 0.2f;                        // the object
  matte.flags(4, 4) = kFlagPoorFit;                   // not known
  matte.modes(5, 4, 1)[1] = matte.modes(5, 4, 1)[0];  // of two places
  matte.modes(6, 4, 1)[0].x_px = 100.3f;              // beyond the edge
  matte.modes(7, 4, 1)[0].weight = 0.001f;            // dark
  const StageView view = view_of(matte).value();
  EXPECT_EQ(view.monitors[0].sightings.size(), static_cast<size_t>(kWidth / 2 * kHeight - 5));
  for (const Sighting& sighting : view.monitors[0].sightings)
    EXPECT_FALSE(sighting.pixel.y() == 4.5 && sighting.pixel.x() > 3.0 && sighting.pixel.x() < 8.0);
}

// A plan whose bars do not locate the stage leaves its pixels flagged.
TEST(MonitorSightings, AreNeverThoseOfTheObjectBesideAStage) {
  Matte matte = made(true);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x < kWidth / 4) {
        matte.coverage(x, y) = 1.0f;
      } else {
        matte.flags(x, y) = kFlagPoorFit;
      }
    }
  }
  EXPECT_THAT(std::string(view_of(matte).status().message()),
              HasSubstr("fewer than 50 pixels see a known place on a monitor beside the object"));
}

TEST(MonitorSightings, AreThinnedInLargePictures) {
  Matte matte(0, 0, 400, 300, 1);  // 120,000 pixels
  matte.metadata = made(true).metadata;
  matte.metadata.set_width_px(400);
  matte.metadata.set_height_px(300);
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 400; ++x)
      matte.modes(x, y, 1)[0] = {.weight = 1.0f,
                                 .x_px = 5.0f + 0.22f * static_cast<float>(x),
                                 .y_px = 5.0f + 0.22f * static_cast<float>(y)};
  }
  const StageView view = view_of(matte).value();
  ASSERT_EQ(view.monitors.size(), 1u);
  EXPECT_GT(view.monitors[0].sightings.size(), 10000u);
  EXPECT_LE(view.monitors[0].sightings.size(), 20000u);
}

TEST(MonitorSightings, RefuseWhatDoesNotSay) {
  Matte straight = made(true);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      Mode& mode = straight.modes(x, y, 1)[0];
      mode.x_px = (static_cast<float>(x) + 0.5f) * 100.0f / kWidth;
      mode.y_px = (static_cast<float>(y) + 0.5f) * 80.0f / kHeight;
    }
  }
  EXPECT_THAT(std::string(view_of(straight).status().message()),
              HasSubstr("session \"tilt\" did not measure what its pixels see"));
  Matte dark(0, 0, kWidth, kHeight, 1);
  dark.metadata = made(true).metadata;
  EXPECT_THAT(std::string(view_of(dark).status().message()),
              HasSubstr("fewer than 50 pixels see a known place on a monitor beside the object"));
  Matte part(4, 0, kWidth - 4, kHeight, 1);
  part.metadata = made(true).metadata;
  EXPECT_THAT(std::string(view_of(part).status().message()),
              HasSubstr("36x30 px from (4, 0) on, of a picture of 40x30"));
  EXPECT_TRUE(absl::IsDataLoss(sightings_in("nothing").status()));
}

}  // namespace
}  // namespace glasswing
