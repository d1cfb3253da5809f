// A small matte and two rays, for tests of what browsers get.
#pragma once

#include "core/matte/matte.h"
#include "core/rays/ray_matte.h"

namespace glasswing {

inline constexpr int kWidth = 5, kHeight = 4;

// The last row sees no picture; pixel (1, 1) is not solved.
inline Matte a_matte() {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(1920);
  monitor.set_height_px(1080);
  for (int y = 0; y < kHeight - 1; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x == 1 && y == 1) {
        matte.flags(x, y) = kFlagNoData;
        continue;
      }
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.25f * static_cast<float>(c + 1),
                                   .x_px = static_cast<float>(100 + x),
                                   .y_px = static_cast<float>(200 + y),
                                   .xx_px2 = 4.0f,
                                   .xy_px2 = 0.0f,
                                   .yy_px2 = 1.0f,
                                   .texture = 0};
      }
      // Blue has a place of its own too, of which an eye sees nothing where it is weak.
      matte.modes(x, y, 2)[1] = {.weight = x == 0 ? 0.5f : 0.001f,
                                 .x_px = 1000.0f,
                                 .y_px = 500.0f,
                                 .xx_px2 = 1.0f,
                                 .xy_px2 = 0.0f,
                                 .yy_px2 = 1.0f,
                                 .texture = 0};
    }
  }
  return matte;
}

// Two pixels that look ahead, one of them through something that takes half of the light.
inline RayMatte two_rays() {
  RayMatte rays(2, 1, 1);
  rays.metadata.set_format_version(1);
  rays.metadata.mutable_matte()->set_session("vase");
  v1::CameraGeometry& camera = *rays.metadata.mutable_geometry()->mutable_camera();
  camera.set_width_px(2);
  camera.set_fx_px(1.0);  // 90 degrees across
  for (int x = 0; x < 2; ++x) {
    for (int c = 0; c < kChannels; ++c) {
      Ray& ray = rays.rays(x, 0, c)[0];
      ray.weight = x == 0 ? 1.0f : 0.5f;
      ray.direction = Eigen::Vector3f(0.0f, 0.0f, 1.0f);
      ray.direction_spread[0] = {0.01f, 0.0f, 0.0f};
      ray.direction_spread[1] = {0.0f, 0.005f, 0.0f};
    }
  }
  return rays;
}

}  // namespace glasswing
