#include "core/radiometry/display_response.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace glasswing {
namespace {

// A monitor of gamma 2.2, slightly different in each primary, with a black level and crosstalk in the
// camera's filters.
struct Monitor {
  std::array<double, 3> gamma{2.2, 2.15, 2.3};
  std::array<std::array<double, 3>, 3> crosstalk{
      {{0.62, 0.09, 0.01}, {0.07, 0.66, 0.08}, {0.01, 0.11, 0.58}}};
  std::array<double, 3> black{0.004, 0.006, 0.009};

  std::array<double, 3> light(const std::array<int, 3>& code, int bits) const {
    std::array<double, 3> sum = black;
    for (size_t p = 0; p < 3; ++p) {
      const double radiance = std::pow(code[p] / static_cast<double>((1 << bits) - 1), gamma[p]);
      for (size_t c = 0; c < 3; ++c) sum[c] += crosstalk[c][p] * radiance;
    }
    return sum;
  }
};

constexpr int kGrays = 17;
using Disturbance = std::function<void(ShownSolid&)>;

// Black and white are shown before each primary's grays and at the end; pictures are a second apart.
std::vector<ShownSolid> recorded(
    const Monitor& monitor, int bits, double noise, std::uint64_t seed,
    const Disturbance& disturb = [](ShownSolid&) {}) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const int highest = (1 << bits) - 1;
  std::vector<ShownSolid> solids;
  const auto show = [&](std::array<int, 3> code) {
    ShownSolid solid{.code = code,
                     .light = monitor.light(code, bits),
                     .at = std::chrono::seconds(static_cast<std::int64_t>(solids.size()))};
    disturb(solid);
    for (size_t c = 0; c < 3; ++c) {
      solid.error[c] = noise * std::sqrt(0.1 + solid.light[c]);
      solid.light[c] += solid.error[c] * normal(random);
    }
    solids.push_back(solid);
  };
  for (size_t p = 0; p < 3; ++p) {
    show({0, 0, 0});
    show({highest, highest, highest});
    for (int i = 1; i < kGrays; ++i) {
      std::array<int, 3> code{};
      code[p] = static_cast<int>(std::lround(highest * static_cast<double>(i) / (kGrays - 1)));
      show(code);
    }
  }
  show({0, 0, 0});
  show({highest, highest, highest});
  return solids;
}

// Over all codes and random colours, of the camera's full scale.
double worst_error(const DisplayResponse& response, const Monitor& monitor, int bits) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> any(0, (1 << bits) - 1);
  double worst = 0.0;
  for (int trial = 0; trial < 10000; ++trial) {
    const std::array<int, 3> code{any(random), any(random), any(random)};
    const auto got = response.light(
        {static_cast<double>(code[0]), static_cast<double>(code[1]), static_cast<double>(code[2])});
    const auto truth = monitor.light(code, bits);
    for (size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(got[c] - truth[c]));
  }
  return worst;
}

double worst_curve_error(const DisplayResponse& response, const Monitor& monitor, int bits) {
  double worst = 0.0;
  for (size_t p = 0; p < 3; ++p) {
    for (int k = 0; k < (1 << bits); ++k) {
      const double truth = std::pow(k / static_cast<double>((1 << bits) - 1), monitor.gamma[p]);
      worst = std::max(worst, std::abs(response.primary[p].curve.radiance(k) - truth));
    }
  }
  return worst;
}

// The goal is 0.5 % of full scale. The noise of each mean is 0.1 % at white, 0.03 % at black.
TEST(DisplayResponse, RecoversTheMonitor) {
  const Monitor monitor;
  for (const int bits : {8, 10}) {
    double curve = 0.0, light = 0.0, crosstalk = 0.0;
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const DisplayResponse response =
          fit_display_response(recorded(monitor, bits, 0.001, seed), bits).value();
      curve = std::max(curve, worst_curve_error(response, monitor, bits));
      light = std::max(light, worst_error(response, monitor, bits));
      for (size_t c = 0; c < 3; ++c) {
        for (size_t p = 0; p < 3; ++p) {
          crosstalk = std::max(crosstalk, std::abs(response.crosstalk[c][p] - monitor.crosstalk[c][p]));
        }
        // The mean of four blacks, to four standard errors.
        EXPECT_NEAR(response.black[c], monitor.black[c], 4.0 * 0.001 * std::sqrt(0.11 / 4.0));
      }
      EXPECT_LT(std::abs(response.excess_of_white.value()), 0.005);
    }
    std::printf(
        "%d bits, worst of 5 runs, of full scale: curves %.3f %%, crosstalk %.3f %%, colours as seen "
        "%.3f %%\n",
        bits, 100.0 * curve, 100.0 * crosstalk, 100.0 * light);
    EXPECT_LE(curve, 0.005);
    EXPECT_LE(crosstalk, 0.005);
    EXPECT_LE(light, 0.005);
  }
}

// A backlight that warms up: 6 % brighter at the end.
TEST(DisplayResponse, DriftIsTakenOut) {
  const Monitor monitor;
  const auto drifts = [](ShownSolid& solid) {
    const double t = std::chrono::duration<double>(solid.at).count() / 55.0;
    for (double& light : solid.light) light *= 1.0 + 0.06 * (1.0 - std::exp(-3.0 * t));
  };
  const std::vector<ShownSolid> solids = recorded(monitor, 8, 0.0005, 1, drifts);
  const DisplayResponse drifted = fit_display_response(solids, 8).value();
  const DisplayResponse response = fit_display_response(without_drift(solids, 8).value(), 8).value();
  // The scale is that of the mean white; errors remain in the curves and the colour balance.
  std::printf("excess of white: %.2f %% with drift, %.2f %% without; curves' worst error %.3f %%, %.3f %%\n",
              100.0 * drifted.excess_of_white.value(), 100.0 * response.excess_of_white.value(),
              100.0 * worst_curve_error(drifted, monitor, 8),
              100.0 * worst_curve_error(response, monitor, 8));
  EXPECT_GT(std::abs(drifted.excess_of_white.value()), 0.005);
  EXPECT_LE(std::abs(response.excess_of_white.value()), 0.005);
  EXPECT_LE(worst_curve_error(response, monitor, 8), 0.005);
}

TEST(DisplayResponse, WithoutDriftNothingChanges) {
  const Monitor monitor;
  std::vector<ShownSolid> solids = recorded(monitor, 8, 0.0, 1);
  const std::vector<ShownSolid> same = without_drift(solids, 8).value();
  for (size_t i = 0; i < solids.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(same[i].light[c], solids[i].light[c], 1e-14);
  }
}

TEST(DisplayResponse, SaysWhatWasSeen) {
  const Monitor monitor;
  const auto message = [](const std::vector<ShownSolid>& solids) {
    return std::string(fit_display_response(solids, 8).status().message());
  };
  const auto with = [&](const Disturbance& disturb) { return recorded(monitor, 8, 0.0005, 1, disturb); };
  const auto says = [](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  says(message(with([](ShownSolid& solid) {
         for (double& light : solid.light) light = std::min(1.3 * light, 0.999);
       })),
       "where light is cut off; it must be 0.95 at most: use a shorter exposure");
  // Auto exposure: each picture appears half as bright as the one before.
  says(message(with([](ShownSolid& solid) {
         if (solid.code[1] > 200) solid.light = {0.1, 0.1, 0.1};
       })),
       "green: code 207 is darker than code 191");
  says(message(with([](ShownSolid& solid) {
         if (solid.code[2] == 16) solid.code[0] = 16;
       })),
       "solid 16 0 16: it must be black (0 0 0), white (255 255 255), or of one primary");
  says(message({}), "black (0 0 0) was not shown");
  std::vector<ShownSolid> solids = with([](ShownSolid&) {});
  std::erase_if(solids, [](const ShownSolid& solid) { return solid.code[0] == 0 && solid.code[2] == 255; });
  says(message(solids), "blue: too few grays: code 255 was not shown");
  solids = with([](ShownSolid& solid) {
    if (solid.at > std::chrono::seconds(30)) {
      for (double& light : solid.light) light *= 0.5;
    }
  });
  says(std::string(without_drift(solids, 8).status().message()), "is auto exposure or auto gain on");
}

}  // namespace
}  // namespace glasswing
