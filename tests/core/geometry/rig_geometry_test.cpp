#include "core/geometry/rig_geometry.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace glasswing
