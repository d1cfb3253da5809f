#include "core/calibration/display_warnings.h"

#include <random>

#include "tests/core/calibration/simulated_grays.h"

namespace glasswing {
namespace {

using DisplayWarnings = SimulatedGrays;

TEST_F(DisplayWarnings, TellsWhiteThatIsNoSum) {
  Rig rig;
  rig.disturb = [](v1::Frame& frame, RadianceImage& light) {
    const auto& colour = frame.stimulus().colour();
    if (frame.stimulus().kind() == "solid" && colour.Get(0) * colour.Get(1) * colour.Get(2) == 1.0) {
      for (float& of : light.samples) of *= 0.97f;
    }
  };
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_NEAR(calibration.excess_of_white(), 1.0 - 1.0 / 0.97, 0.002);
  warns(calibration, "white is 3.1 % darker than its primaries together");
}

TEST_F(DisplayWarnings, TellsFlicker) {
  Rig rig;
  std::mt19937 random(1);
  std::normal_distribution<float> normal(1.0f, 0.006f);
  rig.disturb = [&](v1::Frame&, RadianceImage& light) {
    const float flicker = normal(random);
    for (float& of : light.samples) of *= flicker;
  };
  const v1::DisplayCalibration calibration = calibrated(rig);
  warns(calibration, "% between showings: the monitor flickers");
}

TEST_F(DisplayWarnings, TellsThatWhiteIsDark) {
  Rig rig;
  rig.exposures_ms = {{0.7, 0.7}};
  warns(calibrated(rig), "% of the camera's full scale at 0.7 ms: use an exposure of about");
}

TEST_F(DisplayWarnings, TellsRoomLight) {
  Rig rig;
  rig.room = 0.03f;
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  warns(calibration, "% of white: darken the room");
}

TEST_F(DisplayWarnings, TellsCodesThatDoNothing) {
  // A monitor that expects the limited range of television.
  Rig rig;
  rig.tone = [](double code) { return std::pow(std::clamp((255.0 * code - 16.0) / 219.0, 0.0, 1.0), 2.2); };
  v1::DisplayCalibration calibration = calibrated(rig);
  ASSERT_EQ(calibration.warnings_size(), 3);
  says(calibration.warnings(0), "red: codes 0 to 16 are equally dark, and 239 to 255 are equally bright");
  says(calibration.warnings(2), "blue: codes 0 to 16");

  // A monitor of 5 bits, with grays 4 codes apart.
  rig.tone = [](double code) { return std::pow(std::floor(255.0 * code / 8.0) / 31.0, 2.2); };
  rig.grays = 65;
  rig.takes = 1;
  calibration = calibrated(rig);
  ASSERT_EQ(calibration.warnings_size(), 3);
  says(calibration.warnings(1), "does the monitor, its cable or its driver carry fewer bits than 8?");
}

}  // namespace
}  // namespace glasswing
