// The axis of the simulator's own table, found from pictures of its board.
#include <gtest/gtest.h>

#include <cstdio>

#include "core/axis/axis_fit.h"
#include "core/axis/board.h"
#include "core/sim/board_scene.h"
#include "core/sim/sensor.h"
#include "core/sim/transport.h"
#include "tests/core/axis/made_axis.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// The axis stands 200 mm in front of the camera, upright: y points down.
constexpr MonitorSize kBack{.width_px = 160, .height_px = 120};
constexpr double kPitch_mm = 1.0, kFocalWidths = 1.75;
constexpr int kWidth_px = 320, kHeight_px = 240;
const Eigen::Vector3d kDirection(0.0, 1.0, 0.0), kPoint_mm(0.0, 0.0, 200.0);

v1::CameraGeometry true_camera() {
  MadeCamera camera{.fx = kFocalWidths * kWidth_px,
                    .fy = kFocalWidths * kWidth_px,
                    .cx = kWidth_px / 2.0,
                    .cy = kHeight_px / 2.0};
  camera.k1 = camera.k2 = camera.p1 = camera.p2 = 0.0;
  return geometry_of(camera);
}

// What the camera sees of the board, in the sensor's own noise.
RadianceImage picture(double turn_deg, int seed, int frame) {
  const std::vector<SceneMonitor> monitors{{.name = "back", .size = kBack, .pitch_mm = kPitch_mm}};
  const Transport transport = *build_transport("board", true, monitors, kWidth_px, kHeight_px, kRaysAcross,
                                               kFocalWidths, {.turn_deg = turn_deg, .wobble_deg = 0.02});
  std::vector<RadianceImage> black(1);
  SensorModel sensor;
  sensor.seed = static_cast<std::uint64_t>(seed);
  sensor.read_sd = 0.002;
  sensor.gain = 0.0004;
  const Image16 codes = expose(transport.respond(black), sensor.full_scale_exposure_ms, sensor, frame);
  RadianceImage light(kWidth_px, kHeight_px);
  for (size_t i = 0; i < light.samples.size(); ++i) light.samples[i] = radiance_of(codes.samples[i]);
  return light;
}

TEST(BoardAxis, IsFoundOnASimulatedTableWithinItsStatedErrors) {
  const Board board = *parse_board("--board", "7x5:8:6:4", "4x4_100");
  int within = 0, count = 0;
  for (int seed = 1; seed <= 10; ++seed) {
    // Each from other positions.
    const std::vector<double> at = positions(7.3 * seed, 7.3 * seed + 337.5, 16);
    std::vector<AxisSighting> seen;
    for (int i = 0; i < static_cast<int>(at.size()); ++i) {
      const absl::StatusOr<std::vector<BoardCorner>> corners = find_corners(board, picture(at[i], seed, i));
      ASSERT_OK(corners);
      EXPECT_GE(corners->size(), 12u) << at[i];
      for (const BoardCorner& corner : *corners)
        seen.push_back({.position = i, .board = corner.board, .pixel = corner.pixel, .at_mm = corner.at_mm});
    }
    const absl::StatusOr<AxisFit> fit = fit_axis(true_camera(), at, seen);
    ASSERT_OK(fit);
    const Eigen::Vector3d direction = vector_of(fit->axis.direction()),
                          point = vector_of(fit->axis.point_mm());
    const double off_deg = direction.cross(kDirection).norm() * 180.0 / std::numbers::pi;
    const double off_mm = (point - kPoint_mm).cross(kDirection).norm();
    std::printf(
        "seed %d: %.4f +- %.4f deg, %.4f +- %.4f mm, residuals %.3f px, wobble %.4f deg, runout %.4f, tip "
        "%.3f deg, shift %.4f mm, turn "
        "%.3f deg:",
        seed, off_deg, fit->errors.direction_sd_deg, off_mm, fit->errors.point_sd_mm, fit->axis.residual_px(),
        fit->axis.wobble_deg(), fit->axis.runout_mm(), fit->axis.tip_deg(), fit->axis.shift_mm(),
        fit->axis.turn_deg());
    EXPECT_LE(off_deg, 0.05);
    EXPECT_LE(off_mm, 0.05);
    for (const double error : in_standard_errors(fit->axis, kDirection, kPoint_mm)) {
      std::printf(" %.2f", error);
      ++count;
      within += std::abs(error) < 1.0 ? 1 : 0;
    }
    std::printf("\n");
  }
  const double share = static_cast<double>(within) / count;
  std::printf("%.3f of %d errors are within one standard error\n", share, count);
  EXPECT_GE(share, 0.6);
  EXPECT_LE(share, 0.75);
}

}  // namespace
}  // namespace glasswing
