#include "solver/hierarchical/box_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr double kNoise = 0.002;

BoxMonitor monitor(bool solids, bool complements, int width_px = 96, int height_px = 64) {
  BoxMonitor monitor;
  monitor.width_px = width_px;
  monitor.height_px = height_px;
  const auto add = [&](int axis, size_t wave, double sign) {
    monitor.patterns.push_back(
        {.axis = axis, .wave = wave, .sign = sign, .light = {1.0, 1.0, 1.0}, .shot = {}});
  };
  if (solids) add(BoxPattern::kSolid, 0, 1.0);
  for (int axis = 0; axis < 2; ++axis) {
    for (double bar_px = 64.0; bar_px >= 1.0; bar_px *= 0.5) {
      std::vector<BarWave>& waves = monitor.waves[axis];
      add(axis, waves.size(), 1.0);
      if (complements) add(axis, waves.size(), -1.0);
      waves.push_back({.bar_px = bar_px});
    }
  }
  return monitor;
}

struct Truth {
  Interval x, y;
  Samples3 weight{};
};

// The samples of a pixel with these boxes, one on each monitor.
class SimulatedPixel {
 public:
  SimulatedPixel(const std::vector<BoxMonitor>& monitors, bool black, double noise, unsigned seed)
      : monitors_(monitors), noise_(0.0, noise), random_(seed) {
    for (size_t m = 0; m < monitors.size(); ++m) pixel_.samples.emplace_back(monitors[m].patterns.size());
    if (black) add(pixel_.black, [](size_t) { return 0.0; });
  }
  void foreground(const Samples3& light) {
    if (pixel_.black.information[0] > 0.0) add(pixel_.black, [&](size_t c) { return light[c]; });
    for (auto& samples : pixel_.samples) {
      for (BoxSample& sample : samples) add(sample, [&](size_t c) { return light[c]; });
    }
  }
  void box(size_t m, const Truth& truth) {
    for (size_t p = 0; p < monitors_[m].patterns.size(); ++p) {
      const double lit = lit_of(m, p, truth);
      for (size_t c = 0; c < kChannels; ++c) pixel_.samples[m][p].radiance[c] += truth.weight[c] * lit;
    }
  }
  // The object leaves part of the background uncovered.
  void straight(size_t m, const Truth& behind, double part) {
    pixel_.has_straight = true;
    for (size_t p = 0; p < monitors_[m].patterns.size(); ++p) {
      const double lit = lit_of(m, p, behind);
      for (size_t c = 0; c < kChannels; ++c) {
        pixel_.samples[m][p].straight[c] = behind.weight[c] * lit;
        pixel_.samples[m][p].radiance[c] += part * behind.weight[c] * lit;
      }
    }
  }
  BoxPixel& pixel() { return pixel_; }

 private:
  template <typename Light>
  void add(BoxSample& sample, const Light& light) {
    for (size_t c = 0; c < kChannels; ++c) {
      if (sample.information[c] == 0.0) {
        sample.information[c] = 1.0 / (noise_.stddev() * noise_.stddev());
        sample.radiance[c] = noise_(random_);
      }
      sample.radiance[c] += light(c);
    }
  }
  double lit_of(size_t m, size_t p, const Truth& truth) const {
    const BoxPattern& pattern = monitors_[m].patterns[p];
    if (pattern.axis == BoxPattern::kSolid) return 1.0;
    const size_t axis = pattern.axis;
    const WaveAxis waves(monitors_[m].waves[axis],
                         axis == 0 ? monitors_[m].width_px : monitors_[m].height_px);
    std::vector<double> v(waves.wave_count());
    waves.means(axis == 0 ? truth.x : truth.y, v);
    return 0.5 * (1.0 + pattern.sign * v[pattern.wave]);
  }

  const std::vector<BoxMonitor>& monitors_;
  std::normal_distribution<double> noise_;
  std::mt19937 random_;
  BoxPixel pixel_;
};

const Truth kBox{{30.2, 41.5}, {20.0, 23.6}, {0.7, 0.5, 0.3}};

// Bars that share edges make some boxes indistinguishable, so the test compares the waves as seen by the
// result and by the truth. The best fit is no further from the samples than the truth is, so it is within
// twice the total noise of the truth: sqrt(K) of one of K waves, plus six as a margin.
void expect_box(const BoxMonitor& monitor, const PixelBox& found, const Truth& truth) {
  ASSERT_TRUE(found.seen);
  const std::array<Interval, 2> sides{truth.x, truth.y};
  for (size_t a = 0; a < 2; ++a) {
    const WaveAxis axis(monitor.waves[a], a == 0 ? monitor.width_px : monitor.height_px);
    const auto count = axis.wave_count();
    std::vector<double> seen(count), true_v(count);
    axis.means(found.side[a], seen);
    axis.means(sides[a], true_v);
    const double noise = 2.0 * kNoise / *std::ranges::max_element(truth.weight);  // of v, from one picture
    for (size_t k = 0; k < count; ++k)
      EXPECT_NEAR(seen[k], true_v[k], 2.0 * noise * (std::sqrt(static_cast<double>(count)) + 6.0)) << a << k;
    EXPECT_NEAR(found.side[a].centre_px(), sides[a].centre_px(), 0.5 * sides[a].length_px());
  }
  for (size_t c = 0; c < kChannels; ++c)
    EXPECT_NEAR(found.weight[c], truth.weight[c], 6.0 * found.weight_sd[c]);
  EXPECT_LT(found.centre_sd_px, 0.1);
}

TEST(BoxFit, FindsBoxLightAndForeground) {
  const std::vector<BoxMonitor> monitors{monitor(true, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel simulated(monitors, true, kNoise, 1);
  simulated.foreground({0.02, 0.1, 0.05});
  simulated.box(0, kBox);
  const BoxFit fit = fitter.fit(simulated.pixel());
  expect_box(monitors[0], fit.boxes[0], kBox);
  EXPECT_NEAR(fit.foreground[1], 0.1, 6.0 * kNoise / std::sqrt(15.0));
  EXPECT_EQ(fit.straight, 0.0);
  // Chi-square of n samples minus unknowns: within six standard deviations of sqrt(2 n).
  EXPECT_NEAR(fit.chi_square, fit.sample_count, 6.0 * std::sqrt(2.0 * fit.sample_count) + 11.0);
}

// Without black and white: waves and complements suffice for F and R.
TEST(BoxFit, NeedsNoSolids) {
  const std::vector<BoxMonitor> monitors{monitor(false, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel simulated(monitors, false, kNoise, 2);
  simulated.foreground({0.02, 0.1, 0.05});
  simulated.box(0, kBox);
  const BoxFit fit = fitter.fit(simulated.pixel());
  expect_box(monitors[0], fit.boxes[0], kBox);
  EXPECT_NEAR(fit.foreground[1], 0.1, 6.0 * kNoise / std::sqrt(15.0));
}

TEST(BoxFit, NeedsNoComplements) {
  const std::vector<BoxMonitor> monitors{monitor(true, false)};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel simulated(monitors, true, kNoise, 3);
  simulated.foreground({0.02, 0.1, 0.05});
  simulated.box(0, kBox);
  expect_box(monitors[0], fitter.fit(simulated.pixel()).boxes[0], kBox);
}

TEST(BoxFit, OneBoxOnEachMonitor) {
  const std::vector<BoxMonitor> monitors{monitor(true, true), monitor(true, true, 80, 64)};
  const Truth other{{5.0, 9.25}, {50.5, 63.0}, {0.1, 0.2, 0.25}};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel simulated(monitors, true, kNoise, 4);
  simulated.foreground({0.0, 0.01, 0.02});
  simulated.box(0, kBox);
  simulated.box(1, other);
  const BoxFit both = fitter.fit(simulated.pixel());
  expect_box(monitors[0], both.boxes[0], kBox);
  expect_box(monitors[1], both.boxes[1], other);
  SimulatedPixel dark(monitors, true, kNoise, 5);
  dark.foreground({0.0, 0.01, 0.02});
  dark.box(0, kBox);
  const BoxFit one = fitter.fit(dark.pixel());
  expect_box(monitors[0], one.boxes[0], kBox);
  EXPECT_FALSE(one.boxes[1].seen);
  EXPECT_EQ(one.boxes[1].weight, Samples3{});
}

// Half of the pixel shows the background straight behind, the other half a box elsewhere.
TEST(BoxFit, PartialCoverIsFound) {
  const std::vector<BoxMonitor> monitors{monitor(true, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  const Truth behind{{70.0, 71.0}, {40.0, 41.0}, {1.0, 1.0, 1.0}};
  SimulatedPixel simulated(monitors, true, kNoise, 6);
  simulated.foreground({0.02, 0.02, 0.02});
  simulated.box(0, kBox);
  simulated.straight(0, behind, 0.4);
  const BoxFit fit = fitter.fit(simulated.pixel());
  expect_box(monitors[0], fit.boxes[0], kBox);
  // Some thirty samples per channel determine it.
  EXPECT_NEAR(fit.straight, 0.4, 6.0 * kNoise);
  SimulatedPixel whole(monitors, true, kNoise, 7);
  whole.foreground({0.02, 0.02, 0.02});
  whole.box(0, kBox);
  whole.straight(0, behind, 0.0);
  EXPECT_EQ(fitter.fit(whole.pixel()).straight, 0.0);
}

// Boxes of any place and width, half covered: alpha is right within 0.1, or said to be unsure.
TEST(BoxFit, PartialCoverIsRightOrUnsure) {
  const std::vector<BoxMonitor> monitors{monitor(true, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  std::mt19937 random(3);
  const auto within = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int flagged = 0, wrong = 0;
  constexpr int kTries = 400;
  for (unsigned i = 0; i < kTries; ++i) {
    const double straight = within(0.2, 0.8), width = std::exp(within(0.0, 2.5)),
                 height = std::exp(within(0.0, 2.5)), x = within(0.0, 96.0 - width),
                 y = within(0.0, 64.0 - height), bx = within(2.0, 92.0), by = within(2.0, 60.0),
                 light = (1.0 - straight) * within(0.3, 1.0);
    SimulatedPixel simulated(monitors, true, kNoise, 100 + i);
    simulated.foreground({0.02, 0.02, 0.02});
    simulated.box(0, {{x, x + width}, {y, y + height}, {light, light, light}});
    simulated.straight(0, {{bx, bx + 1.0}, {by, by + 1.0}, {1.0, 1.0, 1.0}}, straight);
    const BoxFit fit = fitter.fit(simulated.pixel());
    double strongest = 0.0;
    for (const double weight : fit.boxes[0].weight) strongest = std::max(strongest, weight);
    if (fit.boxes[0].misread || fit.cover_unsure || fit.rms > std::max(4.0 * kNoise, 0.05 * strongest)) {
      ++flagged;
    } else if (std::abs(fit.straight - straight) > 0.1) {
      ++wrong;
    }
  }
  EXPECT_LE(flagged, kTries / 5);
  EXPECT_LE(wrong, kTries / 100);
}

// Two positions at once are not a box: the fit reports it.
TEST(BoxFit, TwoPlacesLeaveMoreThanNoise) {
  const std::vector<BoxMonitor> monitors{monitor(true, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel simulated(monitors, true, kNoise, 8);
  simulated.foreground({0.0, 0.0, 0.0});
  simulated.box(0, kBox);
  simulated.box(0, {{80.0, 81.0}, {50.0, 51.0}, {0.5, 0.5, 0.5}});
  const BoxFit fit = fitter.fit(simulated.pixel());
  EXPECT_GT(fit.rms, 10.0 * kNoise);
  // Solids are exact whatever the footprint: the whole of both weights.
  EXPECT_NEAR(fit.boxes[0].weight[0], 1.2, 0.05);
}

TEST(BoxFit, NoLightAndNoSamplesAreNoBox) {
  const std::vector<BoxMonitor> monitors{monitor(true, true)};
  BoxFitter fitter(monitors, kMaxHalos);
  SimulatedPixel dark(monitors, true, kNoise, 9);
  dark.foreground({0.3, 0.3, 0.3});
  const BoxFit fit = fitter.fit(dark.pixel());
  EXPECT_FALSE(fit.boxes[0].seen);
  EXPECT_NEAR(fit.foreground[2], 0.3, 6.0 * kNoise / std::sqrt(30.0));
  for (BoxSample& sample : dark.pixel().samples[0]) sample.information = {};
  dark.pixel().black.information = {};
  EXPECT_EQ(fitter.fit(dark.pixel()).sample_count, 0);
}

// The unit of light is arbitrary: errors of shares and places do not depend on it, except for what the
// iterations leave.
TEST(BoxFit, ErrorsDoNotDependOnTheUnitOfLight) {
  constexpr double kUnit = 1e4;
  std::vector<BoxMonitor> monitors{monitor(true, true)};
  SimulatedPixel simulated(monitors, true, kNoise, 3);
  simulated.foreground({0.02, 0.1, 0.05});
  simulated.box(0, kBox);
  BoxPixel& pixel = simulated.pixel();
  const PixelBox before = BoxFitter(monitors, kMaxHalos).fit(pixel).boxes[0];
  const auto scale = [](BoxSample& sample) {
    for (size_t c = 0; c < kChannels; ++c)
      sample.radiance[c] *= kUnit, sample.information[c] /= kUnit * kUnit;
  };
  scale(pixel.black);
  for (BoxSample& sample : pixel.samples[0]) scale(sample);
  for (BoxPattern& pattern : monitors[0].patterns) pattern.light = {kUnit, kUnit, kUnit};
  const PixelBox after = BoxFitter(monitors, kMaxHalos).fit(pixel).boxes[0];
  EXPECT_NEAR(after.centre_sd_px, before.centre_sd_px, 1e-4 * before.centre_sd_px);
  for (size_t c = 0; c < kChannels; ++c) {
    EXPECT_GT(before.weight_sd[c], 0.0);
    EXPECT_NEAR(after.weight_sd[c], before.weight_sd[c], 1e-4 * before.weight_sd[c]) << c;
  }
}

}  // namespace
}  // namespace glasswing
