// Mattes of an object that leaves light as it is, before a monitor at two depths, in closed form.
#pragma once

#include <string>

#include "core/matte/matte_file.h"

namespace glasswing {

inline constexpr int kStraightWidth = 16, kStraightHeight = 12;
inline constexpr double kStraightFocal = 20.0;  // px; the axis meets the picture's middle

// Poses "near" and "far" of a monitor of 120x80 px of 2 mm, 200 and 250 mm ahead.
inline const std::string kStraightGeometry = R"(
camera { width_px: 16 height_px: 12 fx_px: 20 fy_px: 20 cx_px: 8 cy_px: 6 }
monitors {
  name: "near" width_px: 120 height_px: 80 pitch_mm: 2
  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-120, -80, 200]
}
monitors {
  name: "far" width_px: 120 height_px: 80 pitch_mm: 2
  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-120, -80, 250]
}
warnings: "made by hand"
)";

// The file of one depth. Of `step` x `step` pixels one is in it.
inline std::string straight_matte(const std::string& session, double depth_mm, int step = 1) {
  const int width = (kStraightWidth + step - 1) / step, height = (kStraightHeight + step - 1) / step;
  Matte matte(0, 0, width, height, 1);
  v1::MatteMetadata& metadata = matte.metadata;
  metadata.set_format_version(1);
  metadata.set_session(session);
  metadata.set_width_px(width);
  metadata.set_height_px(height);
  if (step > 1) metadata.set_sampling_px(step);
  v1::Monitor& monitor = *metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(120);
  monitor.set_height_px(80);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      matte.coverage(x, y) = 1.0f;
      const double u = (x * step + 0.5 - 0.5 * kStraightWidth) / kStraightFocal,
                   v = (y * step + 0.5 - 0.5 * kStraightHeight) / kStraightFocal;
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.8f,
                                   .x_px = static_cast<float>(60.0 + depth_mm * u / 2.0),
                                   .y_px = static_cast<float>(40.0 + depth_mm * v / 2.0),
                                   .xx_px2 = 1.0f,
                                   .yy_px2 = 1.0f};
      }
    }
  }
  return encode_matte(matte).value();
}

}  // namespace glasswing
