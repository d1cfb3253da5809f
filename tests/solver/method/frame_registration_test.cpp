#include "solver/method/frame_registration.h"

#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

constexpr int kWidth_px = 40, kHeight_px = 30;

// Waves of no less than five pixels, whose place is known everywhere.
double light_at(double x, double y) {
  return 0.5 + 0.2 * std::sin(1.2 * x + 0.3) + 0.2 * std::cos(0.9 * y - 0.4 * x);
}

constexpr int kFirstRow = 100;

// `turn_rad`: about the top left pixel of the whole picture, as FrameCorrection.
std::vector<std::uint16_t> picture(double dx_px, double dy_px, double turn_rad = 0.0) {
  std::vector<std::uint16_t> samples;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const double right = x - dx_px, down = y + kFirstRow - dy_px;
      const double light = light_at(right + turn_rad * down, down - turn_rad * right - kFirstRow);
      for (int c = 0; c < 3; ++c) samples.push_back(static_cast<std::uint16_t>(std::lround(60000.0 * light)));
    }
  }
  return samples;
}

FrameStack stack_of(const std::vector<std::uint16_t>& still, const std::vector<std::uint16_t>& moved) {
  return {.width_px = kWidth_px,
          .first_row = kFirstRow,
          .row_count = kHeight_px,
          .rows = {still, moved},
          .owner = nullptr};
}

FrameCorrections moved_by(double dx_px, double dy_px, double turn_rad = 0.0) {
  FrameCorrections corrections;
  corrections.of_frame.resize(2);
  corrections.of_frame[1].dx_px = static_cast<float>(dx_px);
  corrections.of_frame[1].dy_px = static_cast<float>(dy_px);
  corrections.of_frame[1].turn_rad = static_cast<float>(turn_rad);
  return corrections;
}

// Lanczos' kernel of five lobes passes waves of five pixels to within 1 %.
TEST(FrameRegistration, MovesWhatLiesAsideBack) {
  constexpr int kFirst = 8, kCount = 12, kEdge = 8;
  for (const auto& [dx_px, dy_px] : {std::pair{0.5, 0.0}, {-0.3, 0.7}, {0.0, -1.5}, {3.2, 2.0}}) {
    const std::vector<std::uint16_t> still = picture(0.0, 0.0), moved = picture(dx_px, dy_px);
    const FrameStack rows = registered_rows(stack_of(still, moved), moved_by(dx_px, dy_px), kFirst, kCount);
    ASSERT_EQ(rows.row_count, kCount);
    EXPECT_EQ(rows.first_row, kFirstRow + kFirst);
    for (int y = 0; y < kCount; ++y) {
      for (int x = kEdge; x < kWidth_px - kEdge; ++x) {
        EXPECT_EQ(rows.at(0, x, y, 1), stack_of(still, moved).at(0, x, y + kFirst, 1));
        EXPECT_NEAR(static_cast<double>(rows.at(1, x, y, 1)), static_cast<double>(rows.at(0, x, y, 1)), 0.005)
            << dx_px << ' ' << dy_px << " at " << x << ' ' << y;
      }
    }
  }
}

// Squares of the turn move a corner, 135 px from the top left pixel, by 135 * 0.01^2 px; the light changes by
// 0.3 a pixel at most.
TEST(FrameRegistration, TurnsWhatIsTurnedBack) {
  constexpr double kTurn_rad = 0.01;
  constexpr int kFirst = 10, kCount = 10, kEdge = 10;
  const std::vector<std::uint16_t> still = picture(0.0, 0.0), turned = picture(1.2, -0.4, kTurn_rad);
  const FrameStack rows =
      registered_rows(stack_of(still, turned), moved_by(1.2, -0.4, kTurn_rad), kFirst, kCount);
  for (int y = 0; y < kCount; ++y) {
    for (int x = kEdge; x < kWidth_px - kEdge; ++x) {
      EXPECT_NEAR(static_cast<double>(rows.at(1, x, y, 1)), static_cast<double>(rows.at(0, x, y, 1)), 0.01)
          << x << ' ' << y;
    }
  }
}

TEST(FrameRegistration, WholePixelsAreCopied) {
  const std::vector<std::uint16_t> still = picture(0.0, 0.0), moved = picture(2.0, -1.0);
  const FrameStack rows = registered_rows(stack_of(still, moved), moved_by(2.0, -1.0), 5, 10);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < kWidth_px - 2; ++x)
      EXPECT_NEAR(static_cast<double>(rows.at(1, x, y, 0)), static_cast<double>(rows.at(0, x, y, 0)), 2e-5);
  }
}

TEST(FrameRegistration, WhatIsSaturatedStaysSo) {
  const std::vector<std::uint16_t> still = picture(0.0, 0.0);
  std::vector<std::uint16_t> moved = still;
  const size_t at = (10 * kWidth_px + 20) * 3;
  moved[at] = 65535;
  const FrameStack rows = registered_rows(stack_of(still, moved), moved_by(0.5, 0.0), 0, kHeight_px);
  for (const int x : {19, 20})
    EXPECT_GE(rows.rows[1][(10 * kWidth_px + static_cast<size_t>(x)) * 3], kSaturatedCode);
  for (const int x : {18, 21})
    EXPECT_LT(rows.rows[1][(10 * kWidth_px + static_cast<size_t>(x)) * 3], kSaturatedCode);
}

// Where noise alone lifts light beyond full scale, as what is beside it tells.
TEST(FrameRegistration, WhatIsBarelySaturatedSpoilsNoOther) {
  const std::vector<std::uint16_t> still = picture(0.0, 0.0);
  std::vector<std::uint16_t> moved(still.size(), 64000);
  const size_t at = (10 * kWidth_px + 20) * 3;
  moved[at] = 65535;
  const FrameStack rows = registered_rows(stack_of(still, moved), moved_by(0.2, 0.0), 0, kHeight_px);
  for (const int x : {18, 19, 20, 21}) {
    EXPECT_EQ(rows.rows[1][(10 * kWidth_px + static_cast<size_t>(x)) * 3] >= kSaturatedCode, x == 20) << x;
  }
}

TEST(FrameRegistration, ReachesAsFarAsFramesMoved) {
  EXPECT_EQ(registration_reach(nullptr, 100), 0);
  const FrameCorrections still = moved_by(0.0, 0.0), moved = moved_by(0.2, -1.5);
  EXPECT_EQ(registration_reach(&still, 100), 0);
  EXPECT_EQ(registration_reach(&moved, 100), 7);  // a kernel of five pixels, two pixels off
  const FrameCorrections turned = moved_by(0.0, -0.5, 0.03);
  EXPECT_EQ(registration_reach(&turned, 100), 8);  // 2.5 px at the right
}

}  // namespace
}  // namespace glasswing
