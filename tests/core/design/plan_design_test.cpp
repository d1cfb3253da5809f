// Designs: they keep to their images, read back as they are, and what they expect follows the noise.
// (tests/solver/mixture holds the expectation against simulated fits.)
#include "core/design/plan_design.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/design/shape_waves.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

RigLimits rig(int width_px, int height_px, int count = 1) {
  RigLimits rig;
  for (int i = 0; i < count; ++i) {
    v1::Monitor& monitor = rig.monitors.emplace_back();
    monitor.set_name("monitor" + std::to_string(i));
    monitor.set_width_px(width_px);
    monitor.set_height_px(height_px);
    monitor.set_refresh_hz(60.0);
  }
  return rig;
}

TEST(PlanDesign, KeepsToItsImagesAndReadsBackAsItIs) {
  for (const auto& [width_px, height_px, monitors] :
       {std::tuple{128, 96, 1}, std::tuple{1920, 1080, 1}, std::tuple{1080, 1920, 2}}) {
    for (const int images : {30, 50, 100, 200}) {
      const RigLimits limits = rig(width_px, height_px, monitors);
      const absl::StatusOr<DesignedPlan> design =
          design_plan({.images = images, .noise = {.read_sd = 0.01, .full_well = {}}}, limits);
      if (images < kMinDesignImages * monitors) {
        ASSERT_TRUE(absl::IsInvalidArgument(design.status()));
        EXPECT_NE(design.status().message().find("it must be at least 56"), std::string::npos);
        continue;
      }
      ASSERT_OK(design);
      const std::vector<Step> steps = expand(design->plan, limits.monitors).value();
      EXPECT_LE(std::ssize(steps), images);
      EXPECT_GE(std::ssize(steps), images - 8 * monitors);
      EXPECT_TRUE(misfits(design->plan, limits).empty());
      const absl::StatusOr<v1::Plan> read =
          parse_plan(plan_text(design->plan, limits, "glasswing plan design"), "designed.txtpb");
      ASSERT_OK(read);
      EXPECT_EQ(read->DebugString(), design->plan.DebugString());
    }
  }
}

// A plan for any shape has waves in more directions than one for Gaussians, and no more images.
TEST(PlanDesign, ForAnyShapeHasWavesInManyDirections) {
  const RigLimits limits = rig(128, 96);
  for (const int images : {50, 100, 374}) {
    const DesignedPlan design =
        design_plan({.images = images, .noise = {.read_sd = 0.005, .full_well = {}}, .any_footprints = true},
                    limits)
            .value();
    const std::vector<Step> steps = expand(design.plan, limits.monitors).value();
    EXPECT_LE(std::ssize(steps), images);
    EXPECT_GE(std::ssize(steps), images - 12);
    EXPECT_GE(design.plan.fringes_size(), 8);
    EXPECT_EQ(design.plan.sweeps_size(), 0);
    for (const v1::Fringes& fringes : design.plan.fringes()) {
      for (const double period_px : fringes.period_px()) EXPECT_GE(period_px, kFinestShape_px);
    }
  }
}

// Without photon noise all errors are in proportion to the noise where data outweigh the prior; and more
// images tell more.
TEST(PlanDesign, ExpectsErrorsInProportionToNoise) {
  const RigLimits limits = rig(128, 96);
  const auto expected = [&](int images, double noise) {
    return design_plan({.images = images, .noise = {.read_sd = noise, .full_well = {}}}, limits)->expected;
  };
  const ExpectedErrors low = expected(100, 0.0005), high = expected(100, 0.001), few = expected(50, 0.001);
  EXPECT_NEAR(high.centre_px / low.centre_px, 2.0, 0.4);
  EXPECT_NEAR(high.weight / low.weight, 2.0, 0.4);
  EXPECT_GT(few.composite, high.composite);
}

// One footprint and one wave of two quadrature phases, weight and Sigma held by a tight prior: phase = 2 pi f
// x tells x alone, sd = noise / (pi f R) once both phases are known.
TEST(ExpectedCovariance, IsThatOfAPhaseInClosedForm) {
  const double f = 1.0 / 16.0, noise = 1e-3, weight = 0.8;
  std::vector<ShownPattern> patterns(1);
  for (const double phase_rad : {0.0, 0.5 * M_PI}) {
    ShownPattern& wave = patterns.emplace_back();
    wave.kind = ShownPattern::Kind::kWave;
    wave.fx = f;
    wave.phase_rad = phase_rad;
  }
  Footprints modes;
  modes.push_back(
      {.weight = weight, .x_px = 60.0, .y_px = 50.0, .xx_px2 = 1e-6, .xy_px2 = 0.0, .yy_px2 = 1e-6});
  const PatternAnswers answers(patterns, {.width_px = 128.0, .height_px = 96.0});
  const Eigen::MatrixXd covariance = expected_covariance(answers, modes, {.read_sd = noise, .full_well = {}},
                                                         {.modes = 1, .low_px = 1e-4, .high_px = 1e-3});
  // F and R are known from black and white to 1.4 noise, and move both samples by up to as much.
  const double sd = noise / (M_PI * f * weight);
  EXPECT_GT(std::sqrt(covariance(1, 1)), 0.99 * sd);
  EXPECT_LT(std::sqrt(covariance(1, 1)), 2.0 * sd);
}

TEST(PlanDesign, PrefersStripesOnlyWhereTheyTellMore) {
  const RigLimits limits = rig(128, 96);
  for (const double full_well : {0.0, 2000.0}) {
    CameraNoise noise{.read_sd = 0.002, .full_well = {}};
    if (full_well > 0.0) noise.full_well = full_well;
    const DesignedPlan design = design_plan({.images = 150, .noise = noise}, limits).value();
    ASSERT_TRUE(design.other_expected);
    EXPECT_LE(design.expected.composite, design.other_expected->composite);
  }
}

}  // namespace
}  // namespace glasswing
