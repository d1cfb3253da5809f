#include "solver/mixture/pattern_lanes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

std::vector<ShownPattern> patterns(bool stripes) {
  std::vector<ShownPattern> all(3);  // white and bars
  all[1].lit.bars = all[2].lit.bars = all[2].lit.horizontal = true;
  all[1].lit.bar_px = 16.0;
  all[2].lit.bar_px = 8.0;
  for (const double degrees : {0.0, 90.0, 45.0, -45.0}) {
    const double angle = degrees * std::numbers::pi / 180.0, c = std::cos(angle), s = std::sin(angle);
    for (const double period_px : {140.0, 41.0, 12.0}) {
      for (const double phase_rad : {0.0, 1.3}) {
        ShownPattern& wave = all.emplace_back();
        wave.kind = ShownPattern::Kind::kWave;
        wave.fx = c / period_px;
        wave.fy = s / period_px;
        wave.phase_rad = phase_rad;
      }
    }
    for (double r_px = 0.0; stripes && r_px < 120.0; r_px += 17.0) {
      ShownPattern& stripe = all.emplace_back();
      stripe.kind = ShownPattern::Kind::kStripe;
      stripe.axis = {.cos_phi = c, .sin_phi = s, .sigma_px = 8.0};
      stripe.r_px = r_px;
    }
  }
  return all;
}

// Lanes of float say what PatternAnswers does, of footprints of any width and place: a value within 1e-5 of
// the light, which is some hundred roundings, and slopes within 1e-4 of what moving by a standard deviation
// changes.
TEST(PatternLanes, AreWhatPatternAnswersSays) {
  std::mt19937 random(5);
  const auto within = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (const bool stripes : {false, true}) {
    const PatternAnswers answers(patterns(stripes), {.width_px = 128.0, .height_px = 96.0});
    const PatternLanes lanes(answers);
    const size_t count = answers.size();
    std::vector<double> exact(PatternLanes::kColumns * count);
    std::vector<float> scale(lanes.size()), columns(PatternLanes::kColumns * lanes.size());
    for (size_t i = 0; i < count; ++i) scale[lanes.lane(i)] = 0.5f;
    for (int i = 0; i < 400; ++i) {
      const double sx = std::exp(within(-2.0, 3.5)), sy = std::exp(within(-2.0, 3.5)),
                   tilt = within(-0.95, 0.95);
      const Footprint mode{.weight = within(0.1, 1.0),
                           .x_px = within(-10.0, 138.0),
                           .y_px = within(-10.0, 106.0),
                           .xx_px2 = sx * sx,
                           .xy_px2 = tilt * sx * sy,
                           .yy_px2 = sy * sy};
      for (const bool through_pixels : {false, true}) {
        answers.of(mode, through_pixels, exact.data(), static_cast<std::ptrdiff_t>(count));
        lanes.answer(mode, through_pixels, scale.data(), columns.data());
        // Where an edge cuts off so little that it is left out, H(0) may have up to 0.6 % of the light more.
        const bool slight = !answers.cut(mode, through_pixels) && near_edge(mode, answers.extent());
        const double unit[] = {mode.weight,
                               1.0,
                               mode.weight / sx,
                               mode.weight / sy,
                               mode.weight / (sx * sx),
                               mode.weight / (sx * sy),
                               mode.weight / (sy * sy)};
        for (size_t p = 0; p < PatternLanes::kColumns; ++p) {
          for (size_t k = 0; k < count; ++k) {
            const double own = 2.0 * static_cast<double>(columns[p * lanes.size() + lanes.lane(k)]);
            EXPECT_NEAR(own, exact[p * count + k],
                        unit[p] * (slight  ? 0.02
                                   : p < 2 ? 1e-5
                                           : 1e-4))
                << "column " << p << " of pattern " << k << ", sigma " << sx << ' ' << sy << " at "
                << mode.x_px << ' ' << mode.y_px << " tilt " << tilt
                << (through_pixels ? ", through pixels" : "");
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace glasswing
