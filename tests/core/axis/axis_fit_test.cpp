#include "core/axis/axis_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/axis/made_axis.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

TEST(AxisFit, FindsTheAxisOfPerfectPoints) {
  const MadeTable table;
  for (const auto& at : {positions(-60, 60, 9), positions(0, 20, 3), positions(50, -50, 7)}) {
    const absl::StatusOr<AxisFit> fit = fit_axis(geometry_of(table.camera), at, sightings(table, at, 1));
    ASSERT_OK(fit);
    EXPECT_LT(degrees_between(vector_of(fit->axis.direction()), table.direction), 1e-5);
    const Eigen::Vector3d off = vector_of(fit->axis.point_mm()) - table.point_mm;
    EXPECT_LT(off.cross(table.direction).norm(), 1e-4);
    EXPECT_LT(fit->axis.residual_px(), 1e-4);
    EXPECT_EQ(fit->positions.size(), at.size());
    EXPECT_EQ(fit->positions[0].used, 35);
  }
}

// Standard errors are those of repeats, with a table that wobbles and a lens that is known within a
// covariance.
TEST(AxisFit, StatesItsErrors) {
  MadeTable table;
  table.noise_px = 0.05;
  table.tip_deg = 0.02;
  table.shift_mm = 0.004;
  const std::vector<double> at = positions(-60, 60, 13);
  const std::array<double, 9> lens_sd{0.3, 0.3, 0.4, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0};
  constexpr int kRepeats = 60;
  int within = 0, count = 0;
  double tip_deg = 0.0;
  for (int seed = 0; seed < kRepeats; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    v1::CameraGeometry camera = geometry_of(table.camera);
    camera.set_fx_px(camera.fx_px() + lens_sd[0] * normal(random));
    camera.set_fy_px(camera.fy_px() + lens_sd[1] * normal(random));
    camera.set_cx_px(camera.cx_px() + lens_sd[2] * normal(random));
    camera.set_cy_px(camera.cy_px() + lens_sd[3] * normal(random));
    for (int i = 0; i < 81; ++i) camera.add_covariance(i % 10 == 0 ? lens_sd[i / 10] * lens_sd[i / 10] : 0.0);
    const absl::StatusOr<AxisFit> fit = fit_axis(camera, at, sightings(table, at, 1000 + seed));
    ASSERT_OK(fit);
    for (const double error : in_standard_errors(fit->axis, table.direction, table.point_mm)) {
      ++count;
      within += std::abs(error) < 1.0 ? 1 : 0;
    }
    EXPECT_NEAR(fit->axis.residual_px(), 0.05, 0.05 * 4.0 / std::sqrt(2 * 13 * 35));
    tip_deg += fit->axis.tip_deg() / kRepeats;
  }
  const double share = static_cast<double>(within) / count;
  std::printf("%.3f of %d errors are within one standard error\n", share, count);
  EXPECT_GE(share, 0.6);
  EXPECT_LE(share, 0.75);
  EXPECT_NEAR(tip_deg, 0.02, 0.005);
}

TEST(AxisFit, LeavesOutPointsThatWereTakenForOthers) {
  MadeTable table;
  table.noise_px = 0.05;
  const std::vector<double> at = positions(-60, 60, 9);
  std::vector<AxisSighting> seen = sightings(table, at, 3);
  for (size_t i = 7; i < seen.size(); i += 40) seen[i].pixel.x() += 6.0;
  const absl::StatusOr<AxisFit> fit = fit_axis(geometry_of(table.camera), at, seen);
  ASSERT_OK(fit);
  EXPECT_LT(degrees_between(vector_of(fit->axis.direction()), table.direction), 0.05);
  int left_out = 0;
  for (const AxisFit::Position& position : fit->positions) left_out += position.left_out;
  EXPECT_GE(left_out, static_cast<int>(seen.size() / 40));
  EXPECT_LE(left_out, static_cast<int>(seen.size() / 40) + 2);
}

TEST(AxisFit, SaysWhatIsMissing) {
  const MadeTable table;
  const auto error = [&](const std::vector<double>& at, std::vector<AxisSighting> seen) {
    return std::string(fit_axis(geometry_of(table.camera), at, seen).status().message());
  };
  EXPECT_THAT(error(positions(0, 90, 2), sightings(table, positions(0, 90, 2), 1)),
              HasSubstr("are seen at 2 of 2 positions"));
  EXPECT_THAT(error(positions(0, 5, 3), sightings(table, positions(0, 5, 3), 1)),
              HasSubstr("span 5 degrees"));
  EXPECT_THAT(error({0, 30, 60}, {}), HasSubstr("are seen at 0 of 3 positions"));
  const std::vector<double> few = positions(0, 30, 4);
  const absl::StatusOr<AxisFit> fit = fit_axis(geometry_of(table.camera), few, sightings(table, few, 1));
  ASSERT_OK(fit);
  ASSERT_EQ(fit->axis.warnings_size(), 2);
  EXPECT_THAT(fit->axis.warnings(0), HasSubstr("seen at 4 positions"));
  EXPECT_THAT(fit->axis.warnings(1), HasSubstr("span 30 degrees"));
}

}  // namespace
}  // namespace glasswing
