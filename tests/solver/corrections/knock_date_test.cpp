// Sweeps of level and upright stripes over an object whose columns see the monitor at different heights, so
// that a shift to the side, which no level stripe shows on the monitor itself, is seen in the object.
#include "solver/corrections/knock_date.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth_px = 40, kHeight_px = 30, kStripes = 28;
constexpr double kShift_px = 0.2, kReadNoise = 0.003;

v1::CaptureManifest manifest() {
  v1::CaptureManifest manifest;
  manifest.add_monitors()->set_name("back");
  manifest.mutable_camera()->set_width_px(kWidth_px);
  manifest.mutable_camera()->set_height_px(kHeight_px);
  for (const double phi_deg : {0.0, 90.0}) {
    for (int i = 0; i < kStripes; ++i) {
      v1::Frame& frame = *manifest.add_frames();
      frame.set_object(true);
      v1::Stimulus& stripe = *frame.mutable_stimulus();
      stripe.set_kind("gauss_stripe");
      stripe.set_panel("back");
      stripe.set_phi_deg(phi_deg);
      stripe.set_sigma_px(4.0);
      stripe.set_peak(1.0);
      stripe.set_r_px(2.0 * i - 8.0);
    }
  }
  return manifest;
}

double light_at(const v1::Stimulus& stripe, double x, double y) {
  const double place = stripe.phi_deg() == 0.0 ? x : y + 5.0 * std::sin(1.1 * x);
  const double away = (place - stripe.r_px()) / stripe.sigma_px();
  return 0.1 + 0.7 * std::exp(-0.5 * away * away);
}

// Everything lies to the right by kShift_px from frame `knock` on; `moved_back`: all frames are.
LightReader frames_of(const v1::CaptureManifest& manifest, int knock, bool moved_back) {
  return [&manifest, knock, moved_back](int row,
                                        const std::vector<int>& frames) -> absl::StatusOr<FrameStack> {
    FrameStack stack{.width_px = kWidth_px, .first_row = row, .row_count = 1, .rows = {}, .owner = nullptr};
    stack.rows.resize(manifest.frames_size());
    const auto owner = std::make_shared<std::vector<std::vector<std::uint16_t>>>();
    for (const int f : frames) {
      std::mt19937 random(static_cast<unsigned>(1000 * row + f));
      std::normal_distribution<double> noise(0.0, kReadNoise);
      const double shift_px = (f >= knock ? kShift_px : 0.0) - (moved_back ? kShift_px : 0.0);
      std::vector<std::uint16_t>& own = owner->emplace_back();
      for (int x = 0; x < kWidth_px; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          const double light = light_at(manifest.frames(f).stimulus(), x - shift_px, row) + noise(random);
          own.push_back(static_cast<std::uint16_t>(std::lround(60000.0 * light)));
        }
      }
    }
    for (size_t i = 0; i < frames.size(); ++i) stack.rows[frames[i]] = (*owner)[i];
    stack.owner = owner;
    return stack;
  };
}

int date_of(int knock, int guess) {
  const v1::CaptureManifest session = manifest();
  std::vector<int> all;
  for (int f = 0; f < session.frames_size(); ++f) all.push_back(f);
  return knock_date(session, all, all, guess, frames_of(session, knock, false),
                    frames_of(session, knock, true))
      .value();
}

TEST(KnockDate, IsThatFromWhichLightFollowsSmoothly) {
  for (const int knock : {kStripes + 3, kStripes + 14, 2 * kStripes - 4}) {
    for (const int guess : {kStripes + 1, kStripes + 14, 2 * kStripes - 1})
      EXPECT_EQ(date_of(knock, guess), knock) << guess;
  }
  EXPECT_EQ(date_of(10, kStripes), 10);  // in the sweep before
}

TEST(KnockDate, BetweenTwoSweepsItStays) {
  EXPECT_EQ(date_of(kStripes, kStripes), kStripes);
}

}  // namespace
}  // namespace glasswing
