// Shifts as four sweeps see them, each along its own direction.
#include "solver/corrections/shift_course.h"

#include <gtest/gtest.h>

#include <functional>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr int kSteps = 30;  // of a sweep
constexpr double kError_px = 0.003;

constexpr double kRadius_px = 400.0;  // of the picture, and usual of what is seen of it: half
constexpr double kTurnError_rad = kError_px / (0.5 * kRadius_px);

struct Shift {
  double dx_px = 0.0, dy_px = 0.0, turn_rad = 0.0;
};

// `part`: of the session; `miss_px`: what a sweep sees beside that, and `error_px` a frame.
FrameReport report_of(const std::function<Shift(double part)>& shift,
                      const std::array<double, 4>& miss_px = {}, double error_px = kError_px) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, error_px), turn_noise(0.0, kTurnError_rad);
  FrameReport report;
  report.beside = 1000;
  report.radius_px = kRadius_px;
  const std::array<double, 4> angles_deg{0.0, 90.0, 45.0, -45.0};
  for (size_t sweep = 0; sweep < angles_deg.size(); ++sweep) {
    const double angle = angles_deg[sweep] * std::numbers::pi / 180.0, cos = std::cos(angle),
                 sin = std::sin(angle);
    for (int i = 0; i < kSteps; ++i) {
      const int frame = static_cast<int>(report.frames.size());
      const Shift own = shift(frame / (4.0 * kSteps));
      const double seen_px = cos * own.dx_px + sin * own.dy_px + miss_px[sweep] + noise(random);
      const double precision = 1.0 / (kError_px * kError_px);
      report.frames.push_back({.measured = true,
                               .dx_px = seen_px * cos,
                               .dy_px = seen_px * sin,
                               .xx = precision * cos * cos,
                               .xy = precision * cos * sin,
                               .yy = precision * sin * sin,
                               .turn_rad = own.turn_rad + turn_noise(random),
                               .turn_sd_rad = kTurnError_rad});
      report.order.push_back(frame);
    }
  }
  return report;
}

TEST(ShiftCourse, AStillCameraIsNotMentioned) {
  const ShiftCourse course = shift_course(report_of([](double) { return Shift(); }));
  EXPECT_EQ(course.warning, "");
  EXPECT_FALSE(course.knock);
}

TEST(ShiftCourse, AKnockIsDatedAndMeasured) {
  for (const Shift size : {Shift{0.2, 0.0}, Shift{-0.4, 0.3}, Shift{0.0, 1.5}}) {
    const ShiftCourse course =
        shift_course(report_of([&](double part) { return part < 0.625 ? Shift() : size; }));
    ASSERT_TRUE(course.knock) << course.warning;
    // The third sweep shows every shift but those along (1, -1).
    EXPECT_EQ(course.knock->frame, 75);
    EXPECT_NEAR(course.knock->dx_px, size.dx_px, 0.005);
    EXPECT_NEAR(course.knock->dy_px, size.dy_px, 0.005);
    EXPECT_EQ(course.warning.find("from frame 75 on everything lies"), 0u) << course.warning;
  }
}

// A turn is seen in every sweep, so it is dated whatever the shift.
TEST(ShiftCourse, ATurnIsDatedAndMeasured) {
  constexpr double kTurn_rad = 0.0007;  // 0.04 degrees: 0.28 px at the corners
  for (const Shift size : {Shift{0.0, 0.0, kTurn_rad}, Shift{-0.4, 0.3, -kTurn_rad}}) {
    const ShiftCourse course =
        shift_course(report_of([&](double part) { return part < 0.625 ? Shift() : size; }));
    ASSERT_TRUE(course.knock) << course.warning;
    EXPECT_EQ(course.knock->frame, 75);
    EXPECT_NEAR(course.knock->turn_rad, size.turn_rad, 0.5 * kTurnError_rad);
    EXPECT_NE(course.warning.find(size.turn_rad > 0.0 ? "is turned by 0.04° clockwise"
                                                      : "is turned by 0.04° counter-clockwise"),
              std::string::npos)
        << course.warning;
  }
}

TEST(ShiftCourse, ACreepIsNoKnock) {
  const ShiftCourse course = shift_course(report_of([](double part) {
    return Shift{0.8 * part, 0.3 * part};
  }));
  EXPECT_FALSE(course.knock);
  EXPECT_EQ(course.warning.find("the picture moves"), 0u) << course.warning;
}

// Flat pixels that beat with the camera's move every frame, and every sweep.
TEST(ShiftCourse, WhatSweepsSeeOtherwiseIsNoMove) {
  const ShiftCourse course =
      shift_course(report_of([](double) { return Shift(); }, {0.0, 0.1, -0.06, 0.08}, 0.02));
  EXPECT_FALSE(course.knock) << course.warning;
}

TEST(ShiftCourse, ATrembleIsSaid) {
  std::mt19937 random(9);
  std::normal_distribution<double> noise(0.0, 0.3);
  const ShiftCourse course = shift_course(report_of([&](double) {
    return Shift{noise(random), noise(random)};
  }));
  EXPECT_EQ(course.warning.find("the picture trembles"), 0u) << course.warning;
}

}  // namespace
}  // namespace glasswing
