#include "core/radiometry/tone_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace glasswing {
namespace {

using Law = std::function<double(double)>;  // of x in [0, 1]

double srgb(double x) {
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}
// The S shape of a panel under the gamma of its table.
double s_shaped(double x) {
  const double l = std::pow(x, 2.2);
  return l + 0.06 * std::sin(2.0 * 3.14159265358979 * l) / (2.0 * 3.14159265358979);
}

std::vector<TonePoint> measured(const Law& law, int grays, double noise, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<TonePoint> points;
  for (int i = 0; i < grays; ++i) {
    const int code = static_cast<int>(std::lround(255.0 * i / (grays - 1)));
    // Shot noise over read noise; black level 0.01, full scale 0.8.
    const double light = 0.01 + 0.79 * law(code / 255.0), error = noise * std::sqrt(0.1 + light);
    points.push_back({.code = code, .light = light + error * normal(random), .error = error});
  }
  return points;
}

double worst_error(const ToneFit& fit, const Law& law) {
  double worst = 0.0;
  for (int k = 0; k < 256; ++k) worst = std::max(worst, std::abs(fit.curve.radiance(k) - law(k / 255.0)));
  return worst;
}

TEST(ToneCurve, CodesAndRadiancesAreInverses) {
  const ToneCurve curve = ToneCurve::power(2.2, 8);
  for (double code = 0.0; code <= 255.0; code += 0.0625)
    EXPECT_NEAR(curve.code_for(curve.radiance(code)), code, 1e-9);
  for (double radiance = 0.0; radiance <= 1.0; radiance += 1.0 / 4096.0)
    EXPECT_NEAR(curve.radiance(curve.code_for(radiance)), radiance, 1e-15);
}

TEST(ToneCurve, MixesRadiancesNotCodes) {
  const ToneCurve curve = ToneCurve::power(2.2, 8);
  const double half_way = 0.5 * (std::pow(10 / 255.0, 2.2) + std::pow(11 / 255.0, 2.2));
  EXPECT_NEAR(curve.code_for(half_way), 10.5, 1e-9);
}

TEST(ToneCurve, EndsHoldBeyondThem) {
  const ToneCurve curve = ToneCurve::power(2.2, 10);
  EXPECT_EQ(curve.code_for(0.0), 0.0);
  EXPECT_EQ(curve.code_for(-1.0), 0.0);
  EXPECT_EQ(curve.code_for(std::nan("")), 0.0);
  EXPECT_EQ(curve.code_for(2.0), 1023.0);
  EXPECT_EQ(curve.radiance(2000.0), 1.0);
}

// A monitor whose darkest codes are all black: radiance 0 is code 0, and any more lies above these codes.
TEST(ToneCurve, CrushedBlacksAreNoTrap) {
  std::vector<double> radiances(256, 0.0);
  for (size_t k = 5; k < 256; ++k) radiances[k] = static_cast<double>(k - 4) / 251.0;
  const ToneCurve curve = ToneCurve::create(radiances).value();
  EXPECT_EQ(curve.code_for(0.0), 0.0);
  EXPECT_NEAR(curve.code_for(0.5 / 251.0), 4.5, 1e-9);
}

TEST(ToneCurve, RefusesWhatIsNone) {
  EXPECT_EQ(ToneCurve::create({0.0, 1.0}).status().message(),
            "a response of 2 codes; 256, 512, 1024, 2048 or 4096 can be used");
  std::vector<double> falls(256, 1.0);
  falls[0] = 0.0;
  falls[7] = 0.5;
  EXPECT_EQ(ToneCurve::create(falls).status().message(),
            "a response falls from 1 at code 6 to 0.5 at code 7; it must not fall");
  EXPECT_FALSE(ToneCurve::create(std::vector<double>(256, 0.5)).ok());
}

// The goal is 0.5 % of full scale. Each point's noise is 0.1 % at white, 0.03 % at black.
TEST(ToneFit, RecoversMonitors) {
  const std::vector<std::pair<const char*, Law>> laws{
      {"gamma 2.2", [](double x) { return std::pow(x, 2.2); }},
      {"gamma 1.8", [](double x) { return std::pow(x, 1.8); }},
      {"sRGB", srgb},
      {"S shape", s_shaped}};
  for (const auto& [name, law] : laws) {
    for (const int grays : {17, 33}) {
      double worst = 0.0, square = 0.0, claimed = 0.0;
      for (std::uint64_t seed = 0; seed < 20; ++seed) {
        const ToneFit fit = fit_tone_curve(measured(law, grays, 0.001, seed), 8, "gray").value();
        worst = std::max(worst, worst_error(fit, law));
        for (size_t k = 1; k < 255; ++k) {
          const double error = fit.curve.radiances()[k] - law(static_cast<double>(k) / 255.0);
          square += error * error;
          claimed += fit.error[k] * fit.error[k];
        }
      }
      const double ratio = std::sqrt(square / claimed);
      std::printf(
          "%-10s %d grays: worst error of 20 runs %.3f %% of full scale; errors are %.2f of what is "
          "claimed, rms\n",
          name, grays, 100.0 * worst, ratio);
      EXPECT_LE(worst, 0.005) << name;
      // The stated error is an estimate from a few tens of points: within a factor of 2.
      EXPECT_LE(ratio, 2.0) << name;
      EXPECT_GE(ratio, 0.5) << name;
    }
  }
}

// Without noise the curve equals a power law up to rounding: no smoothing.
TEST(ToneFit, PowerLawsAreExact) {
  const Law law = [](double x) { return std::pow(x, 2.37); };
  std::vector<TonePoint> points;
  for (int code = 0; code <= 255; code += 15) points.push_back({code, 3.0 + 40.0 * law(code / 255.0)});
  const ToneFit fit = fit_tone_curve(points, 8, "gray").value();
  // gamma is searched to 1e-4, which moves x^gamma by at most 1e-4 max |x^g ln x| = 1e-4 / (e g) = 1.6e-5.
  EXPECT_LE(worst_error(fit, law), 2e-5);
  EXPECT_NEAR(fit.full_scale, 40.0, 40.0 * 4e-5);
}

TEST(ToneFit, NeverFalls) {
  std::vector<TonePoint> points = measured([](double x) { return std::pow(x, 2.2); }, 65, 0.02, 3);
  const ToneFit fit = fit_tone_curve(points, 8, "gray").value();
  for (int k = 1; k < 256; ++k) EXPECT_GE(fit.curve.radiance(k), fit.curve.radiance(k - 1));
}

TEST(ToneFit, SaysWhatWasSeen) {
  const Law law = [](double x) { return std::pow(x, 2.2); };
  const auto message = [](const std::vector<TonePoint>& points) {
    return std::string(fit_tone_curve(points, 8, "red").status().message());
  };
  EXPECT_EQ(message(measured(law, 5, 1e-4, 1)),
            "red: too few grays: 5 different codes from 0 to 255; it takes 6 or more, 0 and 255 among them");
  std::vector<TonePoint> falls = measured(law, 17, 1e-4, 1);
  falls[12].light *= 0.8;
  EXPECT_NE(message(falls).find("red: code 191 is darker than code 175, by "), std::string::npos);
  EXPECT_NE(message(falls).find("is auto exposure on, or does the light flicker?"), std::string::npos);
  EXPECT_NE(message(measured([](double) { return 0.0; }, 17, 1e-4, 1)).find("red: no light is seen"),
            std::string::npos);
  std::vector<TonePoint> beyond = measured(law, 17, 1e-4, 1);
  beyond[16].code = 256;
  EXPECT_NE(message(beyond).find("codes go from 0 to 255"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
