#include "core/geometry/pose_check.h"

#include <gtest/gtest.h>

#include "core/geometry/rig_geometry.h"
#include "tests/core/geometry/made_views.h"

namespace glasswing {
namespace {

struct Calibrated {
  MadeCamera camera;
  MadeMonitor monitor;
  MadePose pose{.yaw_deg = 5.0, .pitch_deg = -3.0, .roll_deg = 1.0, .middle_mm = {10.0, -5.0, 600.0}};

  v1::CameraGeometry camera_file() const {
    v1::CameraGeometry file;
    file.set_width_px(camera.width_px);
    file.set_height_px(camera.height_px);
    file.set_fx_px(camera.fx);
    file.set_fy_px(camera.fy);
    file.set_cx_px(camera.cx);
    file.set_cy_px(camera.cy);
    file.set_k1(camera.k1);
    file.set_k2(camera.k2);
    file.set_p1(camera.p1);
    file.set_p2(camera.p2);
    file.set_k3(camera.k3);
    return file;
  }
  v1::MonitorPose pose_file() const {
    v1::MonitorPose file;
    file.set_name("near");
    file.set_width_px(monitor.width_px);
    file.set_height_px(monitor.height_px);
    file.set_pitch_mm(monitor.pitch_mm);
    const Eigen::Matrix3d across = pose.rotation().transpose();
    for (const double value : across.reshaped()) file.add_rotation(value);
    for (const double value : monitor.corner_mm(pose)) file.add_translation_mm(value);
    return file;
  }
  MonitorView seen(const MadePose& now, double noise_px) const {
    std::mt19937 random(3);
    return made_view(camera, monitor, now, "later", noise_px, random);
  }
};

TEST(PoseCheck, NothingHasMoved) {
  const Calibrated rig;
  const PoseCheck check = check_pose(rig.camera_file(), rig.pose_file(), rig.seen(rig.pose, 0.05)).value();
  EXPECT_FALSE(check.has_moved());
  // Of several hundred sightings the mean is better than one by more than ten.
  EXPECT_LT(check.off_px, 0.02);
  EXPECT_LT(check.turn_deg, 0.05);
  EXPECT_LT(check.shift_mm, 0.2);
  EXPECT_NEAR(check.scatter_px, 0.05 * 1.18, 0.02);  // the median length of two normal errors
}

TEST(PoseCheck, TellsBothHowFarAMonitorWasMovedAndTurned) {
  const Calibrated rig;
  MadePose now = rig.pose;
  now.middle_mm += Eigen::Vector3d(1.0, -2.0, 4.0);
  now.yaw_deg += 1.5;
  const PoseCheck check = check_pose(rig.camera_file(), rig.pose_file(), rig.seen(now, 0.0)).value();
  EXPECT_TRUE(check.has_moved());
  EXPECT_NEAR(check.shift_mm, std::sqrt(21.0), 1e-3);
  EXPECT_NEAR(check.away_mm, 4.0, 1e-3);
  EXPECT_NEAR(check.turn_deg, 1.5, 1e-3);
  EXPECT_LT(check.scatter_px, 1e-3);
}

TEST(PoseCheck, SeesAMoveThatIsAFractionOfAPixel) {
  const Calibrated rig;
  MadePose now = rig.pose;
  now.middle_mm.x() += 0.3;  // 0.3 mm * 820 px / 600 mm = 0.41 px
  const PoseCheck check = check_pose(rig.camera_file(), rig.pose_file(), rig.seen(now, 0.05)).value();
  EXPECT_TRUE(check.has_moved());
  EXPECT_NEAR(check.off_px, 0.41, 0.03);
}

TEST(PoseCheck, SightingsThatLieAreFew) {
  const Calibrated rig;
  MonitorView view = rig.seen(rig.pose, 0.02);
  for (size_t i = 0; i < view.sightings.size(); i += 10) view.sightings[i].monitor_px.x() += 40.0;
  EXPECT_FALSE(check_pose(rig.camera_file(), rig.pose_file(), view).value().has_moved());
}

// Places that are off by what no pose can do, such as those of a map fitted to coarse bars.
TEST(PoseCheck, AMapThatBendsIsNoMove) {
  const Calibrated rig;
  MonitorView view = rig.seen(rig.pose, 0.02);
  for (Sighting& sighting : view.sightings) {
    const double u = sighting.monitor_px.x() / view.width_px;
    sighting.monitor_px.x() += 8.0 * u * u * u;
  }
  const PoseCheck check = check_pose(rig.camera_file(), rig.pose_file(), view).value();
  EXPECT_GT(check.off_px, PoseCheck::kMoved_px);
  EXPECT_FALSE(check.has_moved()) << check.off_px << " px, scatter " << check.scatter_px;
}

TEST(PoseCheck, AnotherMonitorIsRefused) {
  const Calibrated rig;
  MonitorView view = rig.seen(rig.pose, 0.0);
  view.width_px = 1280;
  EXPECT_TRUE(absl::IsInvalidArgument(check_pose(rig.camera_file(), rig.pose_file(), view).status()));
}

}  // namespace
}  // namespace glasswing
