#include "core/radiometry/camera_response.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace glasswing {
namespace {

using Curve = std::function<double(double exposure)>;  // exposure to code, both 0 to 1

constexpr double kFull = 0.99;  // the saturation level, where a response is 1

Curve gamma(double power) {
  return [power](double exposure) { return std::pow(std::min(exposure, 1.0), 1.0 / power); };
}
double s_curve(double exposure) {
  const double raised = gamma(2.2)(exposure);
  return 0.8 * raised + 0.2 * raised * raised * (3.0 - 2.0 * raised);
}
double srgb(double exposure) {
  return exposure < 0.0031308 ? 12.92 * exposure
                              : 1.055 * std::pow(std::min(exposure, 1.0), 1.0 / 2.4) - 0.055;
}
// A shoulder like that of film.
double film(double exposure) {
  return (1.0 - std::exp(-2.5 * gamma(2.0)(exposure))) / (1.0 - std::exp(-2.5));
}

// A scene of three decades, with read and shot noise, rounded to 10 bits, averaged over `takes` where none is
// clipped.
std::vector<Exposure> shoot(const Curve& curve, const std::vector<double>& times_s, unsigned seed,
                            int takes = 1) {
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
      double sum = 0.0, most = 0.0;
      for (int take = 0; take < takes; ++take) {
        const double seen = value + std::sqrt(1e-7 + 2e-5 * value) * normal(random);
        const double code = std::round(1023.0 * std::min(curve(std::max(seen, 0.0)), 1.0)) / 1023.0;
        sum += code, most = std::max(most, code);
      }
      exposures[j].codes.samples[i] = code16_of(static_cast<float>(most < 1.0 ? sum / takes : 1.0));
    }
  }
  return exposures;
}

const std::vector<double> kTimes_s = {8.0, 4.0, 2.0, 1.0, 0.5};

// The exposures of `glasswing calibrate camera`.
std::vector<double> ladder_s() {
  std::vector<double> times;
  for (const double part : {1.0, 1.6, 2.9, 5.1, 8.3, 15.0, 25.0, 43.0}) times.push_back(8.0 / part);
  return times;
}

// The exposure of a code, by bisection.
double truth(const Curve& curve, double code) {
  double exposure = 0.0;
  for (double step = 0.5; step > 1e-9; step *= 0.5) exposure += curve(exposure + step) < code ? step : 0.0;
  return exposure;
}

// Rounding of codes to 10 bits, averaged over a few pixels; the fit treats it as noise, which it is not
// exactly.
constexpr double kRounded = 1e-4;

struct Off {
  double worst = 0.0;             // of full scale
  double squares = 0.0, n = 0.0;  // of errors in units of the stated errors
  double in_claims() const { return std::sqrt(squares / n); }
};

// Over every code that was seen.
void compare(const Curve& curve, const CameraResponse& response, Off& off) {
  const double top = truth(curve, kFull);
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < CameraResponse::kKnots; ++k) {
      const double code = k / (CameraResponse::kKnots - 1.0);
      if (code < response.darkest_seen(c) || code > response.brightest_seen(c)) continue;
      const double error = std::abs(response.exposure_of(code, c) - truth(curve, code) / top);
      off.worst = std::max(off.worst, error);
      off.squares += std::pow(error / std::hypot(response.standard_error(k, c), kRounded), 2);
      off.n += 1.0;
    }
  }
}

// The goal is 0.5 % of full scale. A curve has about ten independent errors, and cameras' bends are not
// spread evenly over their codes as the fit assumes; hence a factor of four for the stated errors.
TEST(CameraResponse, RecoversCamerasWithinHalfAPercentOfFullScale) {
  const std::vector<std::pair<const char*, Curve>> cameras = {{"gamma 1.8", gamma(1.8)},
                                                              {"gamma 2.2", gamma(2.2)},
                                                              {"gamma 2.6", gamma(2.6)},
                                                              {"sRGB", srgb},
                                                              {"S", s_curve},
                                                              {"film", film}};
  ResponseOptions options;
  options.black_level = {0.0, 0.0, 0.0};
  options.alignment_sd_px = 0.0;
  for (const auto& [name, curve] : cameras) {
    Off uneven, powers;
    compare(curve, CameraResponse::fit(shoot(curve, ladder_s(), 1, 4), options).value(), uneven);
    compare(curve, CameraResponse::fit(shoot(curve, kTimes_s, 1), options).value(), powers);
    std::printf("%s: worst %.2f %%, %.1f times what is claimed; powers of two %.2f %%, %.1f times\n", name,
                100.0 * uneven.worst, uneven.in_claims(), 100.0 * powers.worst, powers.in_claims());
    EXPECT_LT(uneven.worst, 0.005) << name;
    EXPECT_LT(powers.worst, 0.005) << name;
    for (const Off& off : {uneven, powers}) {
      EXPECT_LT(off.in_claims(), 4.0) << name;
      EXPECT_GT(off.in_claims(), 0.25) << name;
    }
  }
}

TEST(CameraResponse, RecoversAnSCurveInSeveralSeeds) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Off off;
    compare(s_curve, CameraResponse::fit(shoot(s_curve, kTimes_s, seed)).value(), off);
    compare(s_curve, CameraResponse::fit(shoot(s_curve, ladder_s(), seed, 4)).value(), off);
    EXPECT_LT(off.worst, 0.005) << seed;
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
  // The middle one of five: the mean of their logarithms retains a fifth of its error.
  EXPECT_NEAR(response.exposures_s()[2] / response.exposures_s()[1], 0.5, 0.005);
}

TEST(CameraResponse, WhatMovedDoesNotCount) {
  std::vector<Exposure> exposures = shoot(s_curve, kTimes_s, 5);
  for (int y = 0; y < 120; y += 12) {  // a twelfth of the rows of one frame differs
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
