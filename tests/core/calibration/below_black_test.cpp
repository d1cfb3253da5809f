#include "core/calibration/below_black.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr int kKnots = 256;
constexpr double kBlackLight = 0.03, kSd = 0.001;

double coded(double linear) {
  return std::pow(linear, 1.0 / 2.2);
}
double linear(double code) {
  return std::pow(code, 2.2);
}

// The true curve of a camera of gamma 2.2 above its black level, and wrong values below.
v1::CameraCurve curve_above_black() {
  v1::CameraCurve curve;
  curve.set_black_level(coded(kBlackLight));
  for (int k = 0; k < kKnots; ++k) {
    const double code = k / (kKnots - 1.0);
    const double light =
        code >= curve.black_level() ? linear(code) - kBlackLight : 10.0 * (code - curve.black_level());
    curve.add_light(static_cast<float>(light));
  }
  return curve;
}

std::vector<size_t> black_codes(int levels, double black_light) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(black_light, kSd);
  std::vector<size_t> count(65536);
  for (int i = 0; i < 200000; ++i) {
    const double code = std::round(levels * coded(std::max(noise(random), 0.0))) / levels;
    ++count[std::lround(65535.0 * code)];
  }
  return count;
}

TEST(BelowBlack, NoiseThereIsAsFarBelowAsAbove) {
  for (const int levels : {1023, 65535}) {
    v1::CameraCurve curve = curve_above_black();
    continue_below_black(black_codes(levels, kBlackLight), curve);
    for (int k = 1; k < kKnots; ++k) {
      const double code = k / (kKnots - 1.0), light = static_cast<double>(curve.light(k));
      EXPECT_GT(light, static_cast<double>(curve.light(k - 1)));
      const double truth = linear(code) - kBlackLight;
      // Three sd below, where 270 of the samples lie, four sigmas of the counts locate a code to about 0.02
      // sd; codes of 10 bits are 1.3 sd apart there.
      if (truth <= -3.0 * kSd) continue;
      EXPECT_NEAR(light, truth, (levels == 1023 ? 0.25 : 0.15) * kSd) << levels << " " << k;
    }
  }
}

TEST(BelowBlack, BlackThatIsCutOffTellsNothing) {
  v1::CameraCurve curve = curve_above_black();
  const v1::CameraCurve before = curve;
  continue_below_black(black_codes(1023, 0.0), curve);
  EXPECT_EQ(curve.SerializeAsString(), before.SerializeAsString());
}

}  // namespace
}  // namespace glasswing
