#include "solver/hierarchical/wave_axis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

std::vector<BarWave> halves(double widest_px, int count) {
  std::vector<BarWave> waves;
  for (int k = 0; k < count; ++k) waves.push_back({.bar_px = widest_px / std::exp2(k)});
  return waves;
}

std::vector<BarWave> gray_code(int bits) {
  std::vector<BarWave> waves;
  for (int bit = bits - 1; bit >= 0; --bit)
    waves.push_back({.bar_px = std::exp2(bit + 1), .offset_px = std::exp2(bit)});
  return waves;
}

double square(const BarWave& wave, double t_px) {
  const double bar = std::floor((std::floor(t_px) + 0.5 - wave.offset_px) / wave.bar_px);
  return std::fmod(bar, 2.0) == 0.0 ? 1.0 : -1.0;
}

// The mean of a wave, summed at 1/64 px: exact for ends on that grid.
double brute_force(const BarWave& wave, const Interval& interval) {
  constexpr double kStep_px = 1.0 / 64.0;
  double sum = 0.0;
  for (double t = interval.low_px; t < interval.high_px; t += kStep_px)
    sum += square(wave, t + 0.5 * kStep_px) * kStep_px;
  return sum / interval.length_px();
}

TEST(WaveAxis, MeansAreTheWavesOwn) {
  std::mt19937 random(3);
  for (const std::vector<BarWave>& waves :
       {halves(64.0, 7), gray_code(7), std::vector<BarWave>{{2.5, 0.75}}}) {
    const WaveAxis axis(waves, 100);
    std::vector<double> v(waves.size());
    for (int i = 0; i < 50; ++i) {
      const int low = static_cast<int>(random() % 6399),
                high = low + 1 + static_cast<int>(random() % (6400 - low));
      const Interval interval{low / 64.0, high / 64.0};
      axis.means(interval, v);
      for (size_t k = 0; k < waves.size(); ++k)
        EXPECT_NEAR(v[k], brute_force(waves[k], interval), 1e-6) << k << ": " << low << " to " << high;
    }
  }
}

// A Gaussian's mean of bars that go on without end, by the midpoint rule over eight sigmas.
double soft_brute_force(const BarWave& wave, double t_px, double sigma_px) {
  constexpr int kSteps = 20000;
  const double step_px = 16.0 * sigma_px / kSteps;
  double sum = 0.0, all = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double off_px = (i + 0.5) * step_px - 8.0 * sigma_px;
    const double bar = std::floor((t_px + off_px - wave.offset_px) / wave.bar_px);
    const double share = std::exp(-0.5 * off_px * off_px / (sigma_px * sigma_px));
    sum += std::remainder(bar, 2.0) == 0.0 ? share : -share;
    all += share;
  }
  return sum / all;
}

TEST(WaveAxis, SoftMeansAreAGaussians) {
  const std::vector<BarWave> waves = gray_code(12);
  const WaveAxis axis(waves, 4096);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> anywhere_px(0.0, 4096.0), width(-2.0, 6.0);
  for (int i = 0; i < 40; ++i) {
    const WaveAxis::SoftSide side{.t_px = anywhere_px(random), .sigma_px = std::exp2(width(random))};
    const WaveAxis::SoftMeans soft = axis.soft_means(side);
    const double step_px = 1e-3 * side.sigma_px;
    const WaveAxis::SoftMeans beside =
        axis.soft_means({.t_px = side.t_px + step_px, .sigma_px = side.sigma_px});
    const WaveAxis::SoftMeans wider =
        axis.soft_means({.t_px = side.t_px, .sigma_px = side.sigma_px + step_px});
    for (size_t k = 0; k < waves.size(); ++k) {
      const double v = soft.v[k];
      EXPECT_NEAR(v, soft_brute_force(waves[k], side.t_px, side.sigma_px), 2e-3)
          << waves[k].bar_px << " px at " << side.t_px << ", sigma " << side.sigma_px;
      EXPECT_NEAR(soft.by_t[k] * step_px, beside.v[k] - v, 5e-6) << waves[k].bar_px;
      EXPECT_NEAR(soft.by_sigma[k] * step_px, wider.v[k] - v, 5e-6) << waves[k].bar_px;
    }
  }
}

constexpr double kNoise = 0.02;

struct Case {
  std::vector<BarWave> waves;
  int extent_px;
};

// The samples of a footprint that is an interval, two intervals or a ramp, with noise.
std::vector<WaveAxis::Seen> simulate(const Case& c, const WaveAxis& axis, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, kNoise);
  std::vector<double> sum(c.waves.size(), 0.0), v(c.waves.size());
  const int parts = 1 + static_cast<int>(random() % 3);
  for (int part = 0; part < parts; ++part) {
    const double length = std::max(c.extent_px * std::pow(unit(random), 3), 0.1);
    const double low = (c.extent_px - length) * unit(random);
    axis.means({low, low + length}, v);
    for (size_t k = 0; k < v.size(); ++k) sum[k] += v[k] / parts;
  }
  std::vector<WaveAxis::Seen> seen;
  for (const double u : sum) {
    seen.push_back({.u = static_cast<float>(u + noise(random)),
                    .weight = static_cast<float>((0.5 + unit(random)) / (kNoise * kNoise))});
  }
  return seen;
}

// Tries every interval on the grid: none may be better than the search's result.
TEST(WaveAxis, SearchFindsWhatExhaustiveSearchFinds) {
  std::mt19937 random(7);
  for (const Case& c : {Case{halves(64.0, 7), 128}, Case{halves(64.0, 5), 90}, Case{gray_code(7), 96},
                        Case{{{64.0, 0.0}, {8.0, 0.0}, {3.0, 1.5}}, 100}}) {
    const WaveAxis axis(c.waves, c.extent_px);
    for (int i = 0; i < 60; ++i) {
      const std::vector<WaveAxis::Seen> seen = simulate(c, axis, random);
      double least = INFINITY;
      for (double low = 0.0; low < c.extent_px; low += axis.grid_px()) {
        for (double high = low + axis.grid_px(); high <= c.extent_px; high += axis.grid_px())
          least = std::min(least, axis.cost(seen, {low, high}));
      }
      const IntervalFit fit = axis.search(seen);
      EXPECT_LE(fit.cost, least * (1.0 + 1e-5) + 1e-3) << i;  // floats
      EXPECT_EQ(fit.cost, axis.cost(seen, fit.interval)) << i;
    }
  }
}

// Between grid points too: without noise the interval is recovered. Shifts reach no further than a grid
// point, so a few end beside it.
TEST(WaveAxis, EndsLieBetweenPixels) {
  constexpr float kWeight = 1e4f;
  const std::vector<BarWave> waves = halves(64.0, 7);
  const WaveAxis axis(waves, 128);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<double> v(waves.size());
  int found = 0;
  for (int i = 0; i < 100; ++i) {
    const double length = 1.0 + 5.0 * unit(random), low = 120.0 * unit(random);
    axis.means({low, low + length}, v);
    std::vector<WaveAxis::Seen> seen;
    for (const double u : v) seen.push_back({.u = static_cast<float>(u), .weight = kWeight});
    const IntervalFit fit = axis.search(seen);
    // Ends are quantised to 1/64 px; a step changes v by at most twice its length over the interval's. The
    // interval's length costs at most 1.
    const double step = 2.0 / (64.0 * length);
    found += fit.cost <= kWeight * static_cast<double>(waves.size()) * 4.0 * step * step + 1.0 ? 1 : 0;
  }
  EXPECT_GE(found, 95);
}

TEST(WaveAxis, NoHintMisleadsTheSearch) {
  constexpr int kExtent_px = 48;
  const std::vector<BarWave> waves = gray_code(4);
  const WaveAxis axis(waves, kExtent_px);
  std::mt19937 random(11);
  std::uniform_real_distribution<float> light(-1.0f, 1.0f);
  for (int i = 0; i < 100; ++i) {
    std::vector<WaveAxis::Seen> seen;
    for (size_t k = 0; k < waves.size(); ++k) seen.push_back({.u = light(random), .weight = 100.0f});
    double least = INFINITY;
    for (int low = 0; low < kExtent_px; ++low) {
      for (int high = low + 1; high <= kExtent_px; ++high)
        least = std::min(least, axis.cost(seen, {1.0 * low, 1.0 * high}));
    }
    const double hint_px = static_cast<double>(random() % kExtent_px);
    EXPECT_LE(axis.search(seen, {hint_px, hint_px + 1.5}).cost, least + 1e-4 * least) << i;
  }
}

// [39.5, 40.5] and [36, 44] see the same of bars that all have an edge at 40 px: v = 0 for all.
TEST(WaveAxis, OfIntervalsThatAreAlikeTheShortestIsTaken) {
  const std::vector<BarWave> waves = halves(8.0, 4);
  const WaveAxis axis(waves, 48);
  const std::vector<WaveAxis::Seen> seen(waves.size(), {.u = 0.0f, .weight = 1e6f});
  EXPECT_LE(axis.search(seen).interval.length_px(), 1.0);
}

TEST(WaveAxis, PlacesThatLookAlikeAreTold) {
  EXPECT_FALSE(WaveAxis(halves(64.0, 7), 128).alike_px());
  EXPECT_FALSE(WaveAxis(halves(64.0, 5), 128).alike_px());  // within 4 px of each other only
  EXPECT_FALSE(WaveAxis(gray_code(7), 128).alike_px());
  const auto alike_px = WaveAxis(halves(32.0, 6), 128).alike_px();
  ASSERT_TRUE(alike_px);
  EXPECT_EQ((*alike_px)[1] - (*alike_px)[0], 64.0);
  EXPECT_EQ(WaveAxis(halves(32.0, 6), 128).period_px(), 64.0);
  EXPECT_FALSE(WaveAxis(halves(64.0, 7), 128).period_px());
  EXPECT_FALSE(WaveAxis(std::vector<BarWave>{{.bar_px = 32.0}, {.bar_px = 10.0}}, 128).period_px());
}

TEST(WaveAxis, OnePixelAndOneWaveAreEnough) {
  const WaveAxis axis(std::vector<BarWave>{{.bar_px = 4.0}}, 1);
  const std::vector<WaveAxis::Seen> seen{{.u = 0.5f, .weight = 1.0f}};
  const Interval found = axis.search(seen).interval;
  EXPECT_GE(found.low_px, 0.0);
  EXPECT_LE(found.high_px, 1.0);
  EXPECT_GT(found.length_px(), 0.0);
}

}  // namespace
}  // namespace glasswing
