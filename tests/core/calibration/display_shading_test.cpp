#include "core/calibration/display_shading.h"

#include "core/sim/radial_shading.h"
#include "tests/core/calibration/simulated_grays.h"

namespace glasswing {
namespace {

using DisplayShadingTest = SimulatedGrays;

double worst_shading_error(const v1::Uniformity& uniformity, const Rig& rig) {
  const auto mean = [&](int column, int row) {
    const int wide = kScreen.width_px / uniformity.columns(), high = kScreen.height_px / uniformity.rows();
    double sum = 0.0;
    for (int y = row * high; y < (row + 1) * high; ++y) {
      for (int x = column * wide; x < (column + 1) * wide; ++x)
        sum += radial_shading(rig.panel.falloff, x, y, kScreen.width_px, kScreen.height_px);
    }
    return sum / (wide * high);
  };
  const double middle =
      mean(uniformity.columns() / 2, uniformity.rows() / 2);  // equal to its three neighbours
  double worst = 0.0;
  for (int row = 0; row < uniformity.rows(); ++row) {
    for (int column = 0; column < uniformity.columns(); ++column) {
      const double light = uniformity.light(row * uniformity.columns() + column);
      worst = std::max(worst, std::abs(light - mean(column, row) / middle));
    }
  }
  return worst;
}

// Through a lens with known fall-off, and through one with unknown fall-off that has none.
TEST_F(DisplayShadingTest, IsThePanels) {
  for (const double vignetting : {0.2, 0.0}) {
    Rig rig;
    rig.sensor.vignetting = vignetting;
    const v1::Uniformity uniformity = calibrated(rig).uniformity();
    ASSERT_EQ(uniformity.light_size(), 16 * 12);
    const double worst = worst_shading_error(uniformity, rig);
    std::printf("uniformity: worst error %.2f %%\n", 100.0 * worst);
    // A pixel's noise of 0.1 to 0.2 % of full scale corresponds to 0.03 of the screen's width where the ramp
    // is dark, half a cell; over that distance, the light at a corner falls by 0.15 * 2 * 0.03.
    EXPECT_LE(worst, 0.01);
  }
}

TEST_F(DisplayShadingTest, TellsThatPartOfTheScreenIsHidden) {
  const auto hide = [](int from) {
    return [from](v1::Frame&, RadianceImage& light) {
      for (int y = 0; y < kHeight_px; ++y) {
        for (int x = kLeft_px + from; x < kWidth_px; ++x) {
          for (int c = 0; c < 3; ++c) light.at(x, y, c) = 0.0f;
        }
      }
    };
  };
  Rig rig;
  rig.disturb = hide(48);
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  EXPECT_FALSE(calibration.has_uniformity());
  warns(calibration, "the camera sees less than half of the screen");
  // Two columns of cells beyond three quarters are seen; the others are filled from their neighbours.
  rig.disturb = hide(112);
  const v1::Uniformity uniformity = calibrated(rig).uniformity();
  for (int row = 0; row < 12; ++row) {
    for (int column = 14; column < 16; ++column) {
      const float light = uniformity.light(16 * row + column);
      EXPECT_GT(light, 1.0 - rig.panel.falloff);
      EXPECT_LT(light, 1.0);
    }
  }
  rig.disturb = hide(5);  // three columns except their rim
  says(refusal(rig), "of the camera's pixels see its picture; it must be 300 or more");
}

}  // namespace
}  // namespace glasswing
