// The decoder must find every wrong label, and accept every right one.
#include "tests/faults/capture/decoder.h"

#include <gtest/gtest.h>

#include <random>

#include "core/pattern/pattern.h"

namespace glasswing {
namespace {

constexpr MonitorSize kSize{192, 128};
constexpr double kNoise = 0.0035, kStep_px = 0.4;
constexpr View kView{.pattern_rows = 128, .step_px = kStep_px, .noise_sd = kNoise};

v1::Stimulus stripe(double phi_deg, double r_px) {
  v1::Stimulus stimulus;
  stimulus.set_kind("gauss_stripe");
  stimulus.set_phi_deg(phi_deg);
  stimulus.set_r_px(r_px);
  stimulus.set_sigma_px(3.0);
  stimulus.set_peak(1.0);
  return stimulus;
}
v1::Stimulus bars(const std::string& orient, double width_px, bool inverse) {
  v1::Stimulus stimulus;
  stimulus.set_kind("square");
  stimulus.set_orient(orient);
  stimulus.set_bar_width_px(width_px);
  stimulus.set_inverse(inverse);
  return stimulus;
}
v1::Stimulus solid(double r, double g, double b) {
  v1::Stimulus stimulus;
  stimulus.set_kind("solid");
  for (const double value : {r, g, b}) stimulus.add_colour(value);
  return stimulus;
}

// A frame whose upper `rows` show `first`, and the others `second`.
Image16 frame(const v1::Stimulus& first, const v1::Stimulus& second, int rows) {
  static std::mt19937_64 random(5);
  std::normal_distribution<float> noise(0.0f, static_cast<float>(kNoise));
  const RadianceImage above = Pattern::create(first, kSize)->rasterised();
  const RadianceImage below = Pattern::create(second, kSize)->rasterised();
  Image16 image(kSize.width_px, kSize.height_px);
  for (int y = 0; y < kSize.height_px; ++y) {
    for (int x = 0; x < kSize.width_px; ++x) {
      for (int c = 0; c < 3; ++c)
        image.at(x, y, c) = code16_of((y < rows ? above : below).at(x, y, c) + noise(random));
    }
  }
  return image;
}

std::vector<v1::Stimulus> shown() {
  std::vector<v1::Stimulus> all{solid(0, 0, 0), solid(1, 1, 1), solid(0.8, 0.2, 0.1)};
  for (const char* orient : {"vertical_bars", "horizontal_bars"}) {
    for (const double width_px : {64.0, 32.0, 16.0}) {
      for (const bool inverse : {false, true}) all.push_back(bars(orient, width_px, inverse));
    }
  }
  for (const double r_px : {-5.0, 0.0, 40.0, 40.4, 40.8, 100.0}) {
    for (const double phi_deg : {0.0, 90.0, 45.0}) all.push_back(stripe(phi_deg, r_px));
  }
  for (const double r_px : {-40.0, 0.0, 40.0}) all.push_back(stripe(-45.0, r_px));
  return all;
}

TEST(Decoder, TellsEveryStepFromEveryOther) {
  const std::vector<v1::Stimulus> all = shown();
  for (size_t i = 0; i < all.size(); ++i) {
    const Image16 seen = frame(all[i], all[i], kSize.height_px);
    for (size_t j = 0; j < all.size(); ++j) {
      EXPECT_EQ(mismatch(seen, all[j], kView).has_value(), i != j)
          << "shown: " << all[i].ShortDebugString() << "\nlabelled: " << all[j].ShortDebugString() << "\n"
          << mismatch(seen, all[j], kView).value_or("");
    }
  }
}

TEST(Decoder, FindsAFrameOfTwoHalves) {
  for (const int rows : {16, 64, 112}) {
    const Image16 torn = frame(stripe(0.0, 50.0), stripe(0.0, 50.0 + kStep_px), rows);
    EXPECT_TRUE(mismatch(torn, stripe(0.0, 50.0), kView)) << rows;
    EXPECT_TRUE(mismatch(torn, stripe(0.0, 50.0 + kStep_px), kView)) << rows;
  }
}

}  // namespace
}  // namespace glasswing
