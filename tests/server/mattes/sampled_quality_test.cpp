#include "server/mattes/sampled_quality.h"

#include <gtest/gtest.h>

#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

// The object is in the columns below 10, of which the first fits poorly; its widths and errors rise by rows.
// The rest is brighter, and wider than anything.
TEST(SampledQuality, IsThatOfTheObject) {
  constexpr int kWidth = 20, kHeight = 200;
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  matte.metadata.add_monitors()->set_name("back");
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool object = x < 10;
      matte.coverage(x, y) = object ? 1.0F : 0.0F;
      if (x == 0) matte.flags(x, y) = kFlagPoorFit;
      for (int c = 0; c < kChannels; ++c) {
        const float sigma = object ? 1.0F + 0.01F * static_cast<float>(y) : 50.0F;
        matte.modes(x, y, c)[0] = {
            .weight = 0.1F, .x_px = 5.0F, .y_px = 5.0F, .xx_px2 = 900.0F, .yy_px2 = 900.0F};
        matte.modes(x, y, c)[1] = {.weight = 0.5F,
                                   .x_px = 5.0F,
                                   .y_px = 5.0F,
                                   .xx_px2 = sigma * sigma,
                                   .yy_px2 = sigma * sigma,
                                   .centre_sd_px = 0.001F * sigma};
      }
    }
  }
  const TemporaryDirectory directory;
  const std::filesystem::path path = directory.path() / "matte.exr";
  ASSERT_OK(write_file_durably(path, encode_matte(matte).value()));
  const PositionedFile file = PositionedFile::open(path).value();
  const absl::StatusOr<MatteQuality> quality = sampled_quality(file);
  ASSERT_OK(quality);
  EXPECT_DOUBLE_EQ(quality->poor_fit, 0.1);
  // The median row is within a sampled row, three, of the middle; the file rounds to 1/16 of the error.
  EXPECT_NEAR(quality->width_px, 2.0, 0.05);
  EXPECT_NEAR(quality->error_px, 0.002, 0.0005);
}

}  // namespace
}  // namespace glasswing
