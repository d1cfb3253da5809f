#include "compositing/view/compare.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

RadianceImage flat(int width, int height, float radiance) {
  RadianceImage image(width, height);
  std::fill(image.samples.begin(), image.samples.end(), radiance);
  return image;
}

TEST(Difference, OfAConstantOffsetIsThatOffset) {
  const Difference difference = difference_of(flat(5, 4, 0.25f), flat(5, 4, 0.375f), nullptr).value();
  EXPECT_DOUBLE_EQ(difference.rms, 0.125);  // exact in binary
  EXPECT_DOUBLE_EQ(difference.psnr_db, -20.0 * std::log10(0.125));
  EXPECT_EQ(difference.pixel_count, 20);
}

TEST(Difference, CountsOnlyWhatTheMatteCovers) {
  RadianceImage a = flat(5, 4, 0.25f);
  a.at(2, 1, 0) = 1.0f;
  Matte matte(0, 0, 5, 4, 1);
  matte.coverage(0, 0) = 1.0f;
  EXPECT_TRUE(std::isinf(difference_of(a, flat(5, 4, 0.25f), &matte)->psnr_db));
  matte.coverage(2, 1) = 1.0f;
  EXPECT_DOUBLE_EQ(difference_of(a, flat(5, 4, 0.25f), &matte)->rms, std::sqrt(0.75 * 0.75 / 6));
}

TEST(Difference, RefusesOtherSizesAndEmptyMattes) {
  EXPECT_TRUE(absl::IsInvalidArgument(difference_of(flat(5, 4, 0), flat(4, 5, 0), nullptr).status()));
  const Matte none(0, 0, 5, 4, 1);
  EXPECT_TRUE(absl::IsInvalidArgument(difference_of(flat(5, 4, 0), flat(5, 4, 0), &none).status()));
  const Matte other(0, 0, 6, 4, 1);
  EXPECT_TRUE(absl::IsInvalidArgument(difference_of(flat(5, 4, 0), flat(5, 4, 0), &other).status()));
}

TEST(Matched, TakesOutGainAndOffsetOfWhatIsCountedAndNothingElse) {
  RadianceImage a(6, 1), b(6, 1);
  Matte matte(0, 0, 6, 1, 1);
  for (int x = 0; x < 6; ++x) {
    matte.coverage(x, 0) = x < 5 ? 1.0f : 0.0f;
    for (int c = 0; c < 3; ++c) {
      a.at(x, 0, c) = 0.125f * static_cast<float>(x);
      b.at(x, 0, c) = x == 5 ? 9.0f : 0.5f * static_cast<float>(c + 1) * a.at(x, 0, c) + 0.25f;
    }
  }
  const RadianceImage fitted = matched(a, b, &matte).value();
  EXPECT_LT(difference_of(fitted, b, &matte)->rms, 1e-7);  // float rounding
  EXPECT_NEAR(fitted.at(5, 0, 1), 1.0f * a.at(5, 0, 1) + 0.25f, 1e-6);
  // A wave that no gain and offset can produce remains: its rms is the residual.
  for (int x = 0; x < 6; ++x) b.at(x, 0, 0) += x % 2 == 0 ? 0.1f : -0.1f;
  const double before = difference_of(a, b, &matte)->rms;
  const double after = difference_of(matched(a, b, &matte).value(), b, &matte)->rms;
  EXPECT_LT(after, before);
  EXPECT_GT(after, 0.04);  // 0.1 in one channel of three, but for a straight line's part in it
}

using CompareCommand = ScratchTest;

TEST_F(CompareCommand, EqualPicturesHaveNoNumberInJson) {
  const std::string path = (scratch_ / "a.exr").string();
  ASSERT_OK(write_radiance(path, flat(5, 4, 0.25f), Encoding::kLinear));
  const Outcome outcome = run_glasswing({"compare", path, path, "--json"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(nlohmann::json::parse(outcome.out)["psnr_db"].is_null());
}

TEST_F(CompareCommand, AFrameOfACalibratedArchiveIsLight) {
  const std::filesystem::path archive = scratch_ / "archive";
  std::filesystem::create_directories(archive / "frames");
  Image16 frame(4, 4);
  std::ranges::fill(frame.samples, std::uint16_t{16384});  // a quarter
  ASSERT_OK(write_file_durably(archive / "frames/000000.tif", encode_tiff(frame)));
  // Light is half of the code.
  const std::string manifest = R"({"format_version": 1, "session": "s", "monitors": [
      {"name": "back", "width_px": 4, "height_px": 4}],
    "camera": {"name": "cam", "width_px": 4, "height_px": 4},
    "frames": [{"file": "frames/000000.tif", "stimulus": {"kind": "solid", "colour": [1, 1, 1], "panel": "back"}}],
    "camera_calibration": {"format_version": 1, "camera": "cam", "saturation": 1,
      "curves": [{"light": [0, 0.5]}, {"light": [0, 0.5]}, {"light": [0, 0.5]}]}})";
  ASSERT_OK(write_file_durably(archive / "manifest.json", manifest));
  const std::string light = (scratch_ / "light.exr").string();
  ASSERT_OK(write_radiance(light, flat(4, 4, 0.125f), Encoding::kLinear));
  const Outcome outcome =
      run_glasswing({"compare", (archive / "frames/000000.tif").string(), light, "--linear", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LT(nlohmann::json::parse(outcome.out)["rms"].get<double>(),
            0.5 / 65535.0);  // a code is not quite a quarter
}

}  // namespace
}  // namespace glasswing
