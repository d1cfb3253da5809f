#include "compositing/hosts/frei0r/object_in_frame.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <numbers>

#include "core/composite/compositor.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"
#include "tests/compositing/host_mattes.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using Frame = std::vector<std::uint8_t>;

Frame waves(int width_px, int height_px) {
  Frame frame;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      for (int c = 0; c < 4; ++c) {
        const double phase =
            2.0 * std::numbers::pi / 3.0 * (x * (c + 1.0) / width_px + y * (3.0 - c) / height_px);
        frame.push_back(static_cast<std::uint8_t>(std::lround(140.0 + 90.0 * std::sin(phase))));
      }
    }
  }
  return frame;
}

double mean_difference(const Frame& a, const Frame& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.size(); ++i) sum += std::abs(int{a[i]} - int{b[i]});
  return sum / static_cast<double>(a.size());
}

class ObjectInFrameTest : public testing::Test {
 protected:
  ~ObjectInFrameTest() override { std::filesystem::remove(path_); }

  ObjectInFrame written(const Matte& matte) const {
    EXPECT_OK(write_file_durably(path_, encode_matte(matte).value()));
    return ObjectInFrame::open(path_).value();
  }

  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("glasswing-" + std::to_string(::getpid()) + "-in-frame.exr");
};

// Of the compositor that integrates each footprint, in codes of sRGB.
TEST_F(ObjectInFrameTest, TheWholePictureIsTheComposite) {
  constexpr int kWidth = 48, kHeight = 40;
  const Matte matte = mixed_matte(kWidth, kHeight);
  const Frame frame = waves(kWidth, kHeight);
  for (const char* const monitor : {"", "left"}) {
    Frame out(frame.size());
    ASSERT_OK(
        written(matte).composite({.whole_picture = true, .monitor = monitor}, kWidth, kHeight, frame, out));
    RadianceImage light(kWidth, kHeight);
    for (size_t i = 0; i < light.samples.size(); ++i)
      light.samples[i] = linear_of_srgb(static_cast<float>(frame[i / 3 * 4 + i % 3]) / 255.0f);
    std::vector<RadianceImage> behind(2);
    behind[*monitor ? 1 : 0] = resized(light, 2 * kWidth, 2 * kHeight);
    const RadianceImage expected = composite(matte, behind).value();
    for (size_t i = 0; i < light.samples.size(); ++i) {
      // 0.002 rms of light is 1.5 codes at most, where sRGB's slope is that of mid grays.
      EXPECT_NEAR(out[i / 3 * 4 + i % 3], 255.0f * srgb_of_linear(expected.samples[i]), 2.0) << i;
    }
    for (size_t i = 3; i < frame.size(); i += 4) EXPECT_EQ(out[i], frame[i]);
  }
}

TEST_F(ObjectInFrameTest, FindsTheMonitorBesideTheObject) {
  const ObjectInFrame object = written(pane());
  ASSERT_EQ(object.monitor_views().size(), 2u);
  ASSERT_TRUE(object.monitor_views()[0].has_value());
  const AffineMap expected{{2.0, 0.0, 40.0}, {0.0, 1.875, 5.0}};
  EXPECT_TRUE(object.monitor_views()[0]->isApprox(expected, 1e-6)) << *object.monitor_views()[0];
  EXPECT_FALSE(object.monitor_views()[1].has_value());
}

TEST_F(ObjectInFrameTest, APaneThatBendsNothingIsInvisibleAnywhere) {
  const ObjectInFrame object = written(pane());
  constexpr int kWidth = 160, kHeight = 96;
  const Frame frame = waves(kWidth, kHeight);
  for (const Placement& placement : {Placement{}, Placement{.x = 0.3, .y = 0.61, .size = 0.8},
                                     Placement{.x = 0.7, .y = -0.1, .size = 1.3}}) {
    Frame out(frame.size());
    ASSERT_OK(object.composite(placement, kWidth, kHeight, frame, out));
    // At the object's edge its last pixel, up to 2.6 px here, fades out over the next: at half of it a light
    // of half a pixel away has half the weight. The waves rise by 5.9 codes a px at most; two roundings.
    for (size_t i = 0; i < frame.size(); ++i)
      ASSERT_NEAR(out[i], frame[i], 2.6 / 4.0 * 5.9 + 1.0) << placement.x << " " << i;
    EXPECT_LT(mean_difference(out, frame), 0.2);
  }
}

TEST_F(ObjectInFrameTest, TheFrameBesideTheObjectStays) {
  Matte matte = pane();
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0].weight *= 0.25f;
    }
  }
  const ObjectInFrame object = written(matte);
  constexpr int kWidth = 160, kHeight = 96;
  const Frame frame = waves(kWidth, kHeight);
  Frame out(frame.size());
  ASSERT_OK(object.composite({.x = 0.25, .size = 0.5}, kWidth, kHeight, frame, out));
  // The picture of 60x48 px, as one of exactly 60x48, has its middle at (40, 48).
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool covered = x >= 25 && x < 55 && y >= 36 && y < 60;
      for (int c = 0; c < 3; ++c) {
        const size_t i = 4 * (y * kWidth + x) + c;
        if (!covered)
          EXPECT_EQ(out[i], frame[i]) << x << " " << y;
        else
          EXPECT_LT(out[i], frame[i]) << x << " " << y;
      }
    }
  }
}

TEST_F(ObjectInFrameTest, SaysWhatIsWrong) {
  const auto said = [this] { return std::string(ObjectInFrame::open(path_).status().message()); };
  EXPECT_NE(said().find(path_.string()), std::string::npos);
  EXPECT_OK(write_file_durably(path_, "not a matte"));
  EXPECT_NE(said().find(path_.string() + ": it is damaged or not a matte"), std::string::npos) << said();

  const Frame frame = waves(8, 8);
  Frame out(frame.size());
  const ObjectInFrame object = written(pane());
  EXPECT_EQ(object.composite({.monitor = "top"}, 8, 8, frame, out).message(),
            "the monitor is \"top\"; this matte has: back, left");
  for (const Placement& placement :
       {Placement{.size = 0.0}, Placement{.x = NAN}, Placement{.y = 1e9}, Placement{.size = 4.1}})
    EXPECT_EQ(object.composite(placement, 8, 8, frame, out).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ObjectInFrameTest, RefusesRays) {
  RayMatte rays = RayMatte(8, 8, 1);
  EXPECT_OK(write_file_durably(path_, encode_rays(rays).value()));
  EXPECT_NE(ObjectInFrame::open(path_).status().message().find("it contains rays"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
