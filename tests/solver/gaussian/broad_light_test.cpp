#include "solver/gaussian/broad_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr double kNoise = 0.005, kSigma_px = 4.0;
constexpr int kWidth = static_cast<int>(kSimulatedExtent.width_px),
              kHeight = static_cast<int>(kSimulatedExtent.height_px);

// How much of each monitor pixel's light a surface sends to the camera.
using Surface = std::function<double(double x_px, double y_px)>;

// Light that falls off as from a matte surface `distance_px` in front of the monitor.
Surface matte_surface(double x_px, double y_px, double distance_px) {
  return [=](double x, double y) {
    const double square = distance_px * distance_px + (x - x_px) * (x - x_px) + (y - y_px) * (y - y_px);
    return 0.4 * distance_px * distance_px / (std::numbers::pi * square * square);
  };
}

double sum_of(const Surface& surface, const std::function<double(double, double)>& light) {
  double sum = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) sum += surface(x + 0.5, y + 0.5) * light(x + 0.5, y + 0.5);
  }
  return sum;
}

// What a camera records above its picture of black, which has noise too.
PixelSamples seen(const Surface& surface, const SampleLayout& layout, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, kNoise);
  PixelSamples samples{.layout = &layout,
                       .y = std::vector<float>(layout.padded_count()),
                       .weight = std::vector<float>(layout.padded_count()),
                       .floor_answer = std::vector<float>(layout.padded_count(), 1.0f)};
  const double black = noise(random);
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      const size_t place = sweep.first + i;
      const double r = sweep.first_r_px + static_cast<double>(layout.offset_px[place]);
      const double light = sum_of(surface, [&](double x, double y) {
        const double z = (x * sweep.axis.cos_phi + y * sweep.axis.sin_phi - r) / sweep.axis.sigma_px;
        return std::exp(-0.5 * z * z);
      });
      samples.y[place] = static_cast<float>(light + noise(random) - black);
      samples.weight[place] = 1.0f;
    }
  }
  samples.areas.push_back({.lit = {},
                           .y = sum_of(surface, [](double, double) { return 1.0; }) + noise(random) - black,
                           .weight = 1.0});
  samples.floor_weight = 1.0;
  return samples;
}

// The light of a mode before a monitor that is lit left of x.
double left_of(const Footprint& mode, double x_px) {
  return mode.weight *
         LitShare(mode, {.width_px = x_px, .height_px = kSimulatedExtent.height_px}).of({}).share;
}

// Stripes in four directions, and white.
class BroadLightTest : public testing::Test {
 protected:
  std::optional<BroadLight::Found> found(const Surface& surface, unsigned seed) {
    return broad_.find(seen(surface, layout_, seed), kNoise, false, averaged_, workspace_);
  }

 private:
  const SampleLayout layout_ = four_sweeps(kSigma_px);
  const BroadLight broad_{layout_, {{LitArea{}}}, kSimulatedExtent};
  PixelSamples averaged_;
  JointWorkspace workspace_;
};

TEST_F(BroadLightTest, OfMatteSurfacesIsFound) {
  unsigned seed = 1;
  for (const Surface& surface :
       {matte_surface(40.0, 30.0, 50.0), matte_surface(110.0, 80.0, 30.0), matte_surface(64.0, 48.0, 120.0),
        Surface([](double, double) { return 0.2 / (kWidth * kHeight); })}) {
    const std::optional<BroadLight::Found> light = found(surface, seed++);
    ASSERT_TRUE(light.has_value()) << seed;
    const Footprint& mode = light->fit.modes[0];
    const double white = sum_of(surface, [](double, double) { return 1.0; });
    // White is known to sqrt(2) of the noise, of which four; what is left of it is the shape's.
    EXPECT_NEAR(left_of(mode, kSimulatedExtent.width_px), white, 4.0 * std::sqrt(2.0) * kNoise);
    for (const double x_px : {32.0, 64.0, 96.0}) {
      const double lit = sum_of(surface, [&](double x, double) { return x < x_px ? 1.0 : 0.0; });
      EXPECT_NEAR(left_of(mode, x_px), lit, 4.0 * std::sqrt(2.0) * kNoise + 0.03 * white)
          << seed << " " << x_px;
    }
  }
}

TEST_F(BroadLightTest, NoiseIsNone) {
  int count = 0;
  for (unsigned seed = 1; seed <= 200; ++seed)
    count += found([](double, double) { return 0.0; }, seed).has_value();
  EXPECT_LE(count, 2);
}

}  // namespace
}  // namespace glasswing
