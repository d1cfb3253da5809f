#include "compositing/dataset/point_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

using Eigen::Vector2d;

constexpr int kWidth_px = 60, kHeight_px = 50;
constexpr double kPitch_mm = 0.25, kSigma_px = 0.8, kFit_px = 0.002;

v1::MonitorPose facing() {
  v1::MonitorPose pose;
  pose.set_width_px(1000), pose.set_height_px(1000);
  pose.set_pitch_mm(kPitch_mm);
  for (const double number : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) pose.add_rotation(number);
  for (const double number : {-100.0, -100.0, 300.0}) pose.add_translation_mm(number);
  return pose;
}

// A view whose pixel (x, y) sees `place(x, y)` of the monitor.
template <typename Place>
DatasetView seeing(const Place& place) {
  DatasetView view;
  view.matte = Matte(0, 0, kWidth_px, kHeight_px, 2);
  v1::Monitor& monitor = *view.matte.metadata.add_monitors();
  monitor.set_width_px(1000), monitor.set_height_px(1000);
  view.monitors.emplace_back(facing());
  view.pose_covariances.emplace_back().setZero();
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      view.matte.coverage(x, y) = 1.0f;
      const Vector2d at = place(x, y);
      for (int c = 0; c < 3; ++c) {
        Mode& mode = view.matte.modes(x, y, c)[0];
        mode.weight = 0.8f;
        mode.x_px = static_cast<float>(at.x()), mode.y_px = static_cast<float>(at.y());
        mode.xx_px2 = mode.yy_px2 = static_cast<float>(kSigma_px * kSigma_px);
        mode.centre_sd_px = static_cast<float>(kFit_px);
      }
    }
  }
  return view;
}

Vector2d plain(double x, double y) {
  return {100.0 + 1.5 * x + 0.2 * y, 80.0 - 0.1 * x + 1.4 * y};
}

TEST(PointErrors, ScatterAboutNeighboursIsPartOfThem) {
  constexpr double kScatter_px = 0.05;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, kScatter_px);
  const DatasetView view = seeing(
      [&](int x, int y) -> Vector2d { return plain(x, y) + Vector2d(normal(random), normal(random)); });
  const ScreenPoints points = screen_points(view, 1, true);
  int within = 0;
  double squares = 0.0, variance = 0.0;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const int pixel = y * kWidth_px + x;
      const double sd_px = points.sd_mm[pixel] / kPitch_mm;
      ASSERT_GT(sd_px, kFit_px);
      const double z = (points.at_px[pixel] - plain(x, y)).norm() / (std::numbers::sqrt2 * sd_px);
      within += z < 1.0;
      squares += z * z, variance += sd_px * sd_px;
    }
  }
  constexpr double kCount = kWidth_px * kHeight_px;
  // Of a normal distribution in two axes 1 - 1/e; each is judged by some fifty differences.
  EXPECT_NEAR(within / kCount, 1.0 - 1.0 / std::numbers::e, 0.05);
  EXPECT_NEAR(std::sqrt(squares / kCount), 1.0, 0.15);
  EXPECT_NEAR(std::sqrt(variance / kCount), kScatter_px, 0.1 * kScatter_px);
}

// The mean over a pixel of a parabola, by its second moment.
TEST(PointErrors, AMapThatBendsIsRightForThePixelsMiddle) {
  constexpr double kBend = 0.06;  // px a px^2
  const auto middle = [](double x, double y) {
    return Vector2d(100.0 + 1.5 * x + 0.5 * kBend * (x - 30.0) * (x - 30.0), 80.0 + 1.5 * y);
  };
  // Of the footprints in the column where the map has the slope 1.5 along both axes; others differ little.
  constexpr double kAperture_px2 = kSigma_px * kSigma_px / (1.5 * 1.5);
  DatasetView view = seeing([&](double x, double y) -> Vector2d {
    return middle(x, y) + Vector2d(0.5 * kAperture_px2 * kBend, 0.0);
  });
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const double slope = 1.5 + kBend * (x - 30.0);
      for (int c = 0; c < 3; ++c)
        view.matte.modes(x, y, c)[0].xx_px2 = static_cast<float>(kAperture_px2 * slope * slope);
    }
  }
  const ScreenPoints points = screen_points(view, 1, true);
  for (const int x : {20, 30, 40}) {
    const int pixel = 25 * kWidth_px + x;
    const Vector2d truth = middle(x, 25), off(points.at_mm[pixel].x() + 100.0 - kPitch_mm * truth.x(),
                                              points.at_mm[pixel].y() + 100.0 - kPitch_mm * truth.y());
    EXPECT_LT(off.norm() / kPitch_mm, 0.02 * kAperture_px2 * kBend) << x;
    const double left_px = 0.25 * 0.5 * kAperture_px2 * kBend / std::numbers::sqrt2;
    EXPECT_NEAR(points.sd_mm[pixel] / kPitch_mm, std::hypot(left_px, kFit_px), 1e-4) << x;
  }
}

TEST(PointErrors, MissingLightIsACutFootprint) {
  DatasetView view = seeing(plain);
  view.matte.modes(30, 25, 1)[0].weight *= 0.7f;
  const ScreenPoints points = screen_points(view, 1, true);
  const double expected_px = kSigma_px * shift_of_cut(0.3) / std::numbers::sqrt2;
  EXPECT_NEAR(points.sd_mm[25 * kWidth_px + 30] / kPitch_mm, expected_px, 1e-3);
  EXPECT_NEAR(points.sd_mm[25 * kWidth_px + 40] / kPitch_mm, kFit_px, 1e-4);
}

TEST(PointErrors, ModesBesideEachOtherAreOneFootprint) {
  DatasetView view = seeing(plain);
  const Vector2d middle = plain(30, 25);
  const auto split = [&](double part_px) {
    const std::span<Mode> modes = view.matte.modes(30, 25, 1);
    modes[1] = modes[0];
    modes[0].weight = 0.5f, modes[1].weight = 0.3f;
    modes[0].x_px = static_cast<float>(middle.x() - 0.3 * part_px);
    modes[1].x_px = static_cast<float>(middle.x() + 0.5 * part_px);
    return screen_points(view, 1, true);
  };
  const int pixel = 25 * kWidth_px + 30;
  // At the weights' distances from their mean.
  EXPECT_NEAR(split(1.0).at_px[pixel].x(), middle.x(), 1e-4);
  EXPECT_GT(split(1.0).sd_mm[pixel], 0.25 * 0.3 * kPitch_mm / std::numbers::sqrt2 - 1e-6);
  // Apart by more than three sigmas it is other light.
  EXPECT_NEAR(split(4.0).at_px[pixel].x(), middle.x() - 1.2, 1e-4);
}

TEST(PointErrors, TheMonitorsPoseIsCommonToThem) {
  constexpr double kShift_mm = 0.3, kTurn_rad = 0.002;
  DatasetView view = seeing(plain);
  view.pose_covariances[0].diagonal() << 0.0, 0.0, kTurn_rad * kTurn_rad, kShift_mm * kShift_mm, 0.0, 0.0;
  const ScreenPoints points = screen_points(view, 1, true);
  const double arm_mm = kPitch_mm * plain(30, 25).norm();
  EXPECT_NEAR(points.sd_mm[25 * kWidth_px + 30],
              std::hypot(kShift_mm, kTurn_rad * arm_mm) / std::numbers::sqrt2, 1e-4);
}

TEST(PointErrors, WithoutNeighboursAnywhereInTheFootprint) {
  const ScreenPoints points =
      screen_points(seeing([](int x, int y) -> Vector2d { return Vector2d(15.0 * x, 18.0 * y); }), 1, true);
  const int pixel = 25 * kWidth_px + 30;
  EXPECT_EQ(points.known[pixel], 1);
  EXPECT_NEAR(points.sd_mm[pixel] / kPitch_mm, std::hypot(kSigma_px / std::numbers::sqrt2, kFit_px), 1e-4);
}

TEST(PointErrors, ACutMovesTheMeanOfTheRest) {
  for (const double share : {0.001, 0.05, 0.3, 0.5}) {
    // By sums: what lies above the cut is gone.
    constexpr double kStep = 1e-4;
    double light = 0.0, sum = 0.0;
    const double all = std::sqrt(2.0 * std::numbers::pi) * (1.0 - share) / kStep;
    for (double at = -8.0; light < all; at += kStep) {
      const double density = std::exp(-0.5 * at * at);
      light += density, sum += density * at;
    }
    EXPECT_NEAR(shift_of_cut(share), -sum / light, 1e-4) << share;
  }
  EXPECT_EQ(shift_of_cut(0.0), 0.0);
}

}  // namespace
}  // namespace glasswing
