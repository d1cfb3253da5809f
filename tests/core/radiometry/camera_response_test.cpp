#include "core/radiometry/camera_response.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace glasswing {
namespace {

using Curve = std::function<double(double exposure)>;  // 0 to 1 to a code of 0 to 1

constexpr double kFull = 0.99;  // the saturation level, where a response is 1

double s_curve(double exposure) {
  const double raised = std::pow(std::min(exposure, 1.0), 1.0 / 2.2);
  return 0.8 * raised + 0.2 * raised * raised * (3.0 - 2.0 * raised);
}

// A scene over three decades, every pixel by chance, with read and shot noise in the exposure, rounded to 10
// bits.
std::vector<Exposure> shoot(const Curve& curve, const std::vector<double>& times_s, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Exposure> exposures;
  for (const double time : times_s) exposures.push_back({time, Image16(120, 120)});
  Image16& first = exposures[0].codes;
  for (size_t i = 0; i < first.samples.size(); ++i) {
    const double radiance =
        std::pow(10.0, -3.0 + 3.0 * static_cast<double>(i) / static_cast<double>(first.samples.size()));
    for (size_t j = 0; j < times_s.size(); ++j) {
      const double value = radiance * times_s[j];
      const double seen = value + std::sqrt(1e-7 + 2e-5 * value) * normal(random);
      const double code = std::round(1023.0 * std::min(curve(std::max(seen, 0.0)), 1.0)) / 1023.0;
      exposures[j].codes.samples[i] = code16_of(static_cast<float>(code));
    }
  }
  return exposures;
}

const std::vector<double> kTimes_s = {8.0, 4.0, 2.0, 1.0, 0.5};

TEST(CameraResponse, RecoversAnSCurveWithinAPercentOfFullScale) {
  const CameraResponse response = CameraResponse::fit(shoot(s_curve, kTimes_s, 1)).value();
  EXPECT_FALSE(response.is_linear());
  double top = 0.0;  // the exposure of the saturation level, by bisection
  for (double step = 0.5; step > 1e-9; step *= 0.5) top += s_curve(top + step) < kFull ? step : 0.0;
  for (int c = 0; c < 3; ++c) {
    for (double exposure = 0.001; exposure < top; exposure += 0.001) {
      EXPECT_NEAR(response.exposure_of(s_curve(exposure), c), exposure / top, 0.01) << exposure;
    }
  }
}

TEST(CameraResponse, IsStrictlyMonotoneAndItsOwnInverse) {
  const CameraResponse response = CameraResponse::fit(shoot(s_curve, kTimes_s, 2)).value();
  for (int c = 0; c < 3; ++c) {
    for (int k = 1; k < 1024; ++k) {
      const double code = k / 1023.0, exposure = response.exposure_of(code, c);
      EXPECT_GT(exposure, response.exposure_of((k - 1) / 1023.0, c));
      EXPECT_NEAR(response.code_of(exposure, c), code, 1e-9);
    }
  }
}

TEST(CameraResponse, RecognisesALinearCameraAndItsBlackLevel) {
  constexpr double kBlack = 0.0625;
  const auto exposures = shoot([](double value) { return kBlack + value; }, kTimes_s, 3);
  ResponseOptions options;
  options.black_level = {kBlack, kBlack, kBlack};
  const CameraResponse response = CameraResponse::fit(exposures, options).value();
  EXPECT_TRUE(response.is_linear());
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(response.black_level(c), kBlack, 0.005);
    for (double code = kBlack; code < kFull; code += 0.01) {
      EXPECT_NEAR(response.exposure_of(code, c), (code - kBlack) / (kFull - kBlack), 0.005);
    }
  }
}

TEST(CameraResponse, FindsAShutterThatIsNotAsDeclared) {
  std::vector<Exposure> exposures = shoot(s_curve, kTimes_s, 4);
  exposures[2].exposure_s *= 1.05;  // was 2 s, says 2.1
  const CameraResponse response = CameraResponse::fit(exposures).value();
  // The middle one of five: the mean of their logarithms keeps a fifth of what it is off.
  EXPECT_NEAR(response.exposures_s()[2] / response.exposures_s()[1], 0.5, 0.005);
}

TEST(CameraResponse, WhatMovedDoesNotCount) {
  std::vector<Exposure> exposures = shoot(s_curve, kTimes_s, 5);
  for (int y = 0; y < 120; y += 12) {  // a twelfth of the rows of one frame show something else
    for (int x = 0; x < 120; ++x) {
      for (int c = 0; c < 3; ++c) exposures[1].codes.at(x, y, c) = 30000;
    }
  }
  const CameraResponse clean = CameraResponse::fit(shoot(s_curve, kTimes_s, 5)).value();
  const CameraResponse moved = CameraResponse::fit(exposures).value();
  for (double code = 0.05; code < kFull; code += 0.01) {
    EXPECT_NEAR(moved.exposure_of(code, 1), clean.exposure_of(code, 1), 0.005) << code;
  }
}

TEST(CameraResponse, BadInput) {
  const auto status = [](const std::vector<Exposure>& exposures, const ResponseOptions& options = {}) {
    return CameraResponse::fit(exposures, options).status();
  };
  const auto good = shoot(s_curve, kTimes_s, 6);
  EXPECT_EQ(status({}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status({good[0]}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status({good[0], good[0]}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status({good[0], {0.0, good[1].codes}}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status({good[0], {1.0, Image16(60, 120)}}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status({{1.0, Image16(8, 8)}, {2.0, Image16(8, 8)}}).code(), absl::StatusCode::kInvalidArgument);
  ResponseOptions options;
  options.saturation = 1.5;
  EXPECT_EQ(status(good, options).code(), absl::StatusCode::kInvalidArgument);
  options = {};
  options.exposure_sd = 0.0;
  EXPECT_EQ(status(good, options).code(), absl::StatusCode::kInvalidArgument);
  const absl::Status clipped = status({{1.0, Image16(32, 32)}, {2.0, Image16(32, 32)}});
  EXPECT_EQ(clipped.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(clipped.message().find("clipped"), std::string_view::npos) << clipped;
  const absl::Status apart = status(shoot(s_curve, {1000.0, 0.002}, 7));
  EXPECT_EQ(apart.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(apart.message().find("share"), std::string_view::npos) << apart;
}

}  // namespace
}  // namespace glasswing
