// A designed plan's archive of a camera that is not calibrated.
#include "solver/mixture/mixture_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/design/plan_design.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

constexpr int kWidth = 24, kRows = 2;
constexpr double kNoise = 0.005;

v1::Monitor monitor() {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(128);
  monitor.set_height_px(96);
  return monitor;
}

// What one pixel's light is of a pattern, over the monitor's pixels; the footprint is two pixels wide or
// more.
double light_of(const v1::Stimulus& stimulus, const Footprint& mode) {
  const double det = mode.xx_px2 * mode.yy_px2 - mode.xy_px2 * mode.xy_px2;
  double sum = 0.0;
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 128; ++x) {
      const double dx = x + 0.5 - mode.x_px, dy = y + 0.5 - mode.y_px;
      const double density =
          std::exp(-0.5 * (mode.yy_px2 * dx * dx - 2.0 * mode.xy_px2 * dx * dy + mode.xx_px2 * dy * dy) /
                   det) /
          (2.0 * std::numbers::pi * std::sqrt(det));
      double light = 0.0;
      switch (kind_of(stimulus)) {
        case StimulusKind::kSolid:
          light = stimulus.colour(0);
          break;
        case StimulusKind::kSquare: {
          const double at = (stimulus.orient() == "vertical_bars" ? x : y) + 0.5;
          light = static_cast<int>(at / stimulus.bar_width_px()) % 2 == 0 ? 1.0 : 0.0;
          break;
        }
        default: {
          const double phi = stimulus.phi_deg() * std::numbers::pi / 180.0;
          const double turns = ((x + 0.5) * std::cos(phi) + (y + 0.5) * std::sin(phi)) / stimulus.period_px();
          light = 0.5 + 0.5 * std::cos(2.0 * std::numbers::pi * (turns - stimulus.phase_deg() / 360.0));
        }
      }
      sum += density * light;
    }
  }
  return mode.weight * sum;
}

// Every pixel of both rows sees through the object, so that nothing without it tells the camera's noise.
TEST(MixtureSolver, FindsTheNoiseWhereARowIsAllObject) {
  const DesignedPlan designed = design_plan({.images = 50, .noise = {.read_sd = kNoise, .full_well = {}}},
                                            {.monitors = {monitor()}, .camera = {}})
                                    .value();
  v1::CaptureManifest manifest;
  manifest.mutable_camera()->set_width_px(kWidth);
  manifest.mutable_camera()->set_height_px(kRows);
  *manifest.add_monitors() = monitor();
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, kNoise);
  std::vector<Footprint> truth;
  for (int i = 0; i < kWidth * kRows; ++i)
    truth.push_back({.weight = 0.8,
                     .x_px = 20.0 + 3.7 * (i % kWidth),
                     .y_px = 30.0 + 1.3 * (i % kWidth) + 9.0 * (i / kWidth),
                     .xx_px2 = 5.0,
                     .xy_px2 = 1.0,
                     .yy_px2 = 4.0});
  std::vector<Image16> frames;
  const std::vector<Step> steps = expand(designed.plan, {monitor()}).value();
  for (const Step& step : steps) {
    if (kind_of(step.stimulus) == StimulusKind::kPatch) continue;
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file(std::to_string(step.number));
    frame.set_object(step.object);
    frame.set_exposure_ms(step.exposure_ms);
    *frame.mutable_stimulus() = step.stimulus;
    Image16& image = frames.emplace_back(kWidth, kRows);
    for (int i = 0; i < kWidth * kRows; ++i) {
      // Without the object the camera looks at the monitor's other end.
      Footprint seen = truth[i];
      if (!step.object)
        seen = {.weight = 0.9,
                .x_px = 120.0 - seen.x_px,
                .y_px = 20.0,
                .xx_px2 = 4.0,
                .xy_px2 = 0.0,
                .yy_px2 = 4.0};
      const double light = (step.object ? 0.1 : 0.02) + light_of(step.stimulus, seen);
      for (int c = 0; c < kChannels; ++c)
        image.samples[i * kChannels + c] =
            static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(light + noise(random), 0.0, 1.0)));
    }
  }
  const auto method = make_method("gaussian", {}).value();
  const Matte matte = solve_in_bands(*method, manifest, stack_of(manifest, frames)).value();
  int right = 0;
  for (int i = 0; i < kWidth * kRows; ++i) {
    const int x = i % kWidth, y = i / kWidth;
    EXPECT_EQ(matte.coverage(x, y), 1.0f) << x;
    for (int c = 0; c < kChannels; ++c) {
      // Noise may split a footprint; where its light comes from stays.
      double light = 0.0, x_px = 0.0, y_px = 0.0;
      for (const Mode& mode : matte.modes(x, y, c)) {
        // One that lies beyond the monitor would change no sample, and its light be any.
        EXPECT_LT(std::hypot(mode.x_px - std::clamp(mode.x_px, 0.0f, 128.0f),
                             mode.y_px - std::clamp(mode.y_px, 0.0f, 96.0f)),
                  5.0f * std::sqrt(mode.xx_px2 + mode.yy_px2) + 1.0f);
        light += static_cast<double>(mode.weight);
        x_px += static_cast<double>(mode.weight * mode.x_px);
        y_px += static_cast<double>(mode.weight * mode.y_px);
      }
      const Footprint& seen = truth[i];
      // Five of the standard errors that the design expects along an axis.
      if (std::hypot(x_px / light - seen.x_px, y_px / light - seen.y_px) < 5.0 * designed.expected.centre_px)
        ++right;
    }
  }
  EXPECT_GE(right, 95 * kWidth * kRows * kChannels / 100);
}

}  // namespace
}  // namespace glasswing
