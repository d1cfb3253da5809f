// The errors that mattes predict of their composites, against the scatter of pixels solved with other noise.
#include "core/footprint/composite_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/composite/compositor.h"
#include "core/footprint/light_slopes.h"
#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr double kNoise = 0.005, kSigma_px = 4.0;
constexpr int kRepeats = 400;

v1::MatteMetadata metadata_of(const SampleLayout& layout) {
  v1::MatteMetadata metadata;
  v1::Monitor& monitor = *metadata.add_monitors();
  monitor.set_width_px(static_cast<int>(kSimulatedExtent.width_px));
  monitor.set_height_px(static_cast<int>(kSimulatedExtent.height_px));
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    v1::StripeSweep& named = *metadata.add_sweeps();
    named.set_phi_deg(std::atan2(sweep.axis.sin_phi, sweep.axis.cos_phi) * 180.0 / std::numbers::pi);
    named.set_sigma_px(sweep.axis.sigma_px);
    named.set_first_r_px(sweep.first_r_px);
    const size_t last = sweep.first + sweep.count - 1;
    named.set_last_r_px(sweep.first_r_px + static_cast<double>(layout.offset_px[last]));
    named.set_count(sweep.count);
  }
  return metadata;
}

// A picture with detail of all sizes.
RadianceImage texture() {
  RadianceImage picture(static_cast<int>(kSimulatedExtent.width_px),
                        static_cast<int>(kSimulatedExtent.height_px));
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        picture.at(x, y, c) = static_cast<float>(0.5 + 0.2 * std::sin(0.9 * x + 0.3 * y + c) +
                                                 0.2 * std::cos(0.11 * x - 0.23 * y));
      }
    }
  }
  return picture;
}

// A row of pixels that all see `truth`, each with other noise.
Matte solved_again_and_again(const Footprints& truth) {
  const SampleLayout layout = four_sweeps(kSigma_px);
  Matte matte(0, 0, kRepeats, 1, kMaxModes);
  matte.metadata = metadata_of(layout);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, kNoise);
  JointWorkspace workspace;
  for (int x = 0; x < kRepeats; ++x) {
    matte.coverage(x, 0) = 1.0f;
    for (int c = 0; c < kChannels; ++c) {
      PixelSamples samples = recorded(truth, layout, kNoise, random);
      const Footprints found = solved(samples, kNoise).modes;
      // Above a picture of black, whose noise the floor takes back.
      const double black = noise(random);
      for (float& y : samples.y) y -= static_cast<float>(black);
      samples.floor_weight = 1.0;
      samples.floor_answer.assign(samples.y.size(), 1.0f);
      const JointFit fit = fit_jointly(samples, found, kSimulatedExtent, {.max_steps = 20}, workspace);
      matte.foreground(x, 0)[c] = static_cast<float>(black + fit.floor);
      for (int m = 0; m < fit.modes.size(); ++m) {
        const size_t i = m;
        matte.modes(x, 0, c)[i] = mode_of(fit.modes[m], fit.weight_sd[i], fit.centre_sd_px[i], 0);
      }
    }
  }
  return matte;
}

TEST(CompositeError, IsTheScatterOfNoisyPixels) {
  const std::vector<RadianceImage> backgrounds = {texture()};
  Footprints narrow, wide, pair;
  narrow.push_back({.weight = 0.8, .x_px = 60.3, .y_px = 40.8, .xx_px2 = 2.0, .xy_px2 = 0.5, .yy_px2 = 1.0});
  wide.push_back(
      {.weight = 0.6, .x_px = 50.2, .y_px = 52.1, .xx_px2 = 60.0, .xy_px2 = -20.0, .yy_px2 = 25.0});
  pair = narrow;
  pair.push_back({.weight = 0.3, .x_px = 75.0, .y_px = 47.0, .xx_px2 = 5.0, .xy_px2 = 0.0, .yy_px2 = 9.0});
  for (const Footprints& truth : {narrow, wide, pair}) {
    const Matte matte = solved_again_and_again(truth);
    const RadianceImage seen = composite(matte, backgrounds).value(),
                        error = composite_error(matte, backgrounds).value();
    for (size_t c = 0; c < kChannels; ++c) {
      double sum = 0.0, squares = 0.0, predicted = 0.0;
      for (size_t i = c; i < seen.samples.size(); i += kChannels) {
        const auto value = static_cast<double>(seen.samples[i]), own = static_cast<double>(error.samples[i]);
        sum += value, squares += value * value, predicted += own * own;
      }
      const double variance = (squares - sum * sum / kRepeats) / (kRepeats - 1);
      // The scatter of 400 is known to 3.5 %, and the prediction good to a few per cent.
      EXPECT_NEAR(std::sqrt(variance / (predicted / kRepeats)), 1.0, 0.15)
          << truth.size() << " modes, the first of " << truth[0].xx_px2 << " px^2, channel " << c;
    }
  }
}

TEST(LightSlopes, AreThoseOfTheExactCompositor) {
  const RadianceImage picture = texture();
  v1::MatteMetadata none;
  none.add_monitors();
  const LitMonitor monitor(picture, PrimaryMix::create(none).value(), 0, 1);
  for (const Footprint& mode :
       {Footprint{1.0, 60.3, 40.8, 2.0, 0.5, 1.0}, Footprint{1.0, 50.2, 52.1, 60.0, -20.0, 25.0},
        Footprint{1.0, 2.0, 52.1, 30.0, -20.0, 25.0}}) {
    const auto light = [&](const Footprint& own) {
      return integrate_footprint(mode_of(own, 0.0, 0.0, 0), picture, 1);
    };
    const LightSlopes own = monitor.slopes(mode, 1);
    EXPECT_NEAR(own.light, light(mode), 0.001);
    const double slopes[] = {own.by_x, own.by_y, own.by_xx, own.by_xy, own.by_yy};
    double Footprint::*const parameters[] = {&Footprint::x_px, &Footprint::y_px, &Footprint::xx_px2,
                                             &Footprint::xy_px2, &Footprint::yy_px2};
    for (size_t p = 0; p < std::size(slopes); ++p) {
      Footprint less = mode, more = mode;
      less.*parameters[p] -= 0.05;
      more.*parameters[p] += 0.05;
      const double slope = (light(more) - light(less)) / 0.1;
      EXPECT_NEAR(slopes[p], slope, 0.1 * std::abs(slope) + 1e-4) << mode.xx_px2 << " px^2, parameter " << p;
    }
  }
}

}  // namespace
}  // namespace glasswing
