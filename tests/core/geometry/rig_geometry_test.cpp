#include "core/geometry/rig_geometry.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::CameraGeometry a_camera() {
  v1::CameraGeometry camera;
  camera.set_width_px(101);
  camera.set_height_px(60);
  camera.set_fx_px(90.0);
  camera.set_fy_px(95.0);
  camera.set_cx_px(48.3);
  camera.set_cy_px(31.7);
  camera.set_k1(-0.1);
  camera.set_p1(0.002);
  camera.add_sd(0.1);
  return camera;
}

// The middle of a sample is that of the pixel that was taken.
TEST(SampledCamera, LooksAlongThePixelsThatAreLeft) {
  for (const int step : {1, 2, 3, 7}) {
    const v1::CameraGeometry camera = a_camera(), sampled = sampled_camera(camera, step);
    const CameraLens whole(camera), part(sampled);
    int columns = 0;
    for (int x = 0; x < camera.width_px(); x += step, ++columns) {
      const Eigen::Vector2d sample(x / step + 0.5, 4.5), pixel(x + 0.5, 4 * step + 0.5);
      EXPECT_LT((part.slope_of(sample) - whole.slope_of(pixel)).norm(), 1e-9) << step << ' ' << x;
    }
    EXPECT_EQ(sampled.width_px(), columns);
    EXPECT_EQ(sampled.sd_size(), step == 1 ? 1 : 0);
  }
}

TEST(CheckGeometry, NamesNumbersThatAreNone) {
  v1::RigGeometry geometry;
  *geometry.mutable_camera() = a_camera();
  v1::MonitorPose& pose = *geometry.add_monitors();
  pose.set_name("near");
  pose.set_width_px(64);
  pose.set_height_px(48);
  pose.set_pitch_mm(1.0);
  for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) pose.add_rotation(r);
  for (const double t : {-32.0, -24.0, 200.0}) pose.add_translation_mm(t);
  ASSERT_OK(check_geometry(geometry));
  geometry.mutable_camera()->set_cx_px(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(check_geometry(geometry).message(),
            "cx_px of the camera is nan; it must be a number of up to 1000000000");
  geometry.mutable_camera()->set_cx_px(48.0);
  pose.set_translation_mm(1, 1e300);
  EXPECT_EQ(check_geometry(geometry).message(),
            "translation_mm of pose \"near\" is 1e+300; it must be a number of up to 1000000000");
}

}  // namespace
}  // namespace glasswing
