#include "compositing/view/blur.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth_px = 30, kHeight_px = 24;
// Jacobian of the centres, monitor px per camera px: a camera that is rotated a little and looks from the
// side.
constexpr double kXbyX = 1.5, kXbyY = 0.2, kYbyX = -0.3, kYbyY = 2.0;
constexpr double kXX = 6.25, kYY = 4.0;

// An empty stage. Measured widths always differ; as many are above as below the nominal one.
Matte empty_stage() {
  Matte matte(0, 0, kWidth_px, kHeight_px, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_method("gaussian");
  matte.metadata.set_width_px(kWidth_px);
  matte.metadata.set_height_px(kHeight_px);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(64);
  monitor.set_height_px(64);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const double noise_px2 = 0.1 * ((x + y) % 3 - 1);
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.9f,
                                   .x_px = static_cast<float>(7.0 + kXbyX * x + kXbyY * y),
                                   .y_px = static_cast<float>(9.0 + kYbyX * x + kYbyY * y),
                                   .xx_px2 = static_cast<float>(kXX + noise_px2),
                                   .yy_px2 = static_cast<float>(kYY - noise_px2)};
      }
    }
  }
  return matte;
}

void expect_truth(const BlurRegion& region) {
  constexpr double kRounding = 1e-5;  // floats
  ASSERT_TRUE(region.monitor_px && region.camera_px);
  EXPECT_NEAR((*region.monitor_px)[0], std::sqrt(kXX), kRounding);
  EXPECT_NEAR((*region.monitor_px)[1], std::sqrt(kYY), kRounding);
  // J C J^T = S: the picture's covariance C maps to the measured one on the monitor. Of the three
  // entries of C the two on the diagonal are known, and S's own xy is 0.
  const double det = kXbyX * kYbyY - kXbyY * kYbyX;
  const double cxy = -(kYbyY * kYbyX * kXX + kXbyX * kXbyY * kYY) / (det * det);
  const double cxx = std::pow((*region.camera_px)[0], 2), cyy = std::pow((*region.camera_px)[1], 2);
  EXPECT_NEAR(kXbyX * kXbyX * cxx + 2.0 * kXbyX * kXbyY * cxy + kXbyY * kXbyY * cyy, kXX, 1e-3);
  EXPECT_NEAR(kYbyX * kYbyX * cxx + 2.0 * kYbyX * kYbyY * cxy + kYbyY * kYbyY * cyy, kYY, 1e-3);
}

TEST(Blur, OfAnEmptyStageIsTheSameEverywhere) {
  const Blur blur = blur_of(empty_stage()).value();
  EXPECT_EQ(blur.whole.pixel_count, kWidth_px * kHeight_px);
  expect_truth(blur.whole);
  for (const BlurRegion& region : blur.regions) {
    EXPECT_EQ(region.pixel_count, kWidth_px * kHeight_px / 9);
    expect_truth(region);
  }
}

TEST(Blur, LeavesOutTheObjectAndWhatIsFlagged) {
  Matte matte = empty_stage();
  const auto spoil = [&](int x, int y) {
    for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0].xx_px2 = 100.0f;
  };
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 10; ++x) {  // the top left
      matte.coverage(x, y) = 1.0f;
      spoil(x, y);
    }
    for (int x = 10; x < 19; ++x) {  // nine tenths of the top
      matte.flags(x, y) = kFlagPoorFit;
      spoil(x, y);
    }
  }
  const Blur blur = blur_of(matte).value();
  EXPECT_EQ(blur.regions[0].pixel_count, 0);
  EXPECT_FALSE(blur.regions[0].monitor_px.has_value());
  EXPECT_EQ(blur.regions[1].pixel_count, 8);
  EXPECT_NEAR((*blur.regions[1].monitor_px)[0], std::sqrt(kXX), 0.02);
  EXPECT_FALSE(blur.regions[8].pixel_count == 0);
  expect_truth(blur.regions[8]);
}

TEST(Blur, IsRefusedWhereItWasNotMeasured) {
  Matte covered = empty_stage();
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) covered.coverage(x, y) = 1.0f;
  }
  EXPECT_TRUE(absl::IsInvalidArgument(blur_of(covered).status()));
  Matte straight = empty_stage();
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      for (int c = 0; c < kChannels; ++c) straight.modes(x, y, c)[0].yy_px2 = 0.25f;
    }
  }
  const absl::Status refused = blur_of(straight).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_NE(refused.message().find("square_waves"), std::string::npos);
}

TEST(BlurPicture, IsBrighterWhereItIsWider) {
  Matte matte = empty_stage();
  matte.coverage(0, 0) = 1.0f;
  for (int c = 0; c < kChannels; ++c) matte.modes(5, 5, c)[0].yy_px2 = 36.0f;
  const RadianceImage picture = blur_picture(matte, 8.0);
  EXPECT_EQ(picture.width_px, kWidth_px);
  EXPECT_GT(picture.height_px, kHeight_px);
  const auto brightness = [&](int x, int y) {
    return picture.at(x, y, 0) + picture.at(x, y, 1) + picture.at(x, y, 2);
  };
  EXPECT_GT(brightness(5, 5), brightness(6, 6));
  EXPECT_EQ(picture.at(0, 0, 0), picture.at(0, 0, 2));  // gray
  for (int x = 1; x < kWidth_px; ++x)
    EXPECT_GT(brightness(x, picture.height_px - 1), brightness(x - 1, picture.height_px - 1));
}

using BlurCommand = ScratchTest;

TEST_F(BlurCommand, PrintsATableAndWritesAPicture) {
  const std::string matte = (scratch_ / "m.exr").string(), picture = (scratch_ / "m.png").string();
  ASSERT_OK(write_file_durably(matte, encode_matte(empty_stage()).value()));
  const Outcome table = run_glasswing({"blur", matte, "-o", picture});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_NE(table.out.find("bottom right      80      2.500      2.000"), std::string::npos) << table.out;
  EXPECT_NE(table.out.find("to 8 monitor px"), std::string::npos) << table.out;
  EXPECT_EQ(read_radiance(picture, Encoding::kDisplay)->width_px, kWidth_px);
  const Outcome json = run_glasswing({"blur", matte, "--json"});
  EXPECT_EQ(json.status, 0) << json.err;
  const auto answer = nlohmann::json::parse(json.out);
  EXPECT_EQ(answer["whole"]["pixels"], kWidth_px * kHeight_px);
  EXPECT_NEAR(answer["regions"]["middle"]["sigma_monitor_px"][0].get<double>(), 2.5, 1e-5);
  expect_one_line_error(run_glasswing({"blur", (scratch_ / "none.exr").string()}), "none.exr");
  expect_one_line_error(run_glasswing({"blur", matte, "-o", "blur.gif"}), "blur.gif");
}

}  // namespace
}  // namespace glasswing
