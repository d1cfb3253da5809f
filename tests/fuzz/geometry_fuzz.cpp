// Geometries of cameras and monitors, and rays by them.
#include <google/protobuf/stubs/logging.h>

#include "core/geometry/rig_geometry.h"
#include "core/matte/matte.h"
#include "core/rays/match_rays.h"
#include "core/rays/ray_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

// A mode in the middle of the monitor's third in each pixel of the right half.
Matte seen_before(const v1::CameraGeometry& camera, const v1::MonitorPose& pose, const std::string& monitor) {
  Matte matte(0, 0, camera.width_px(), camera.height_px(), 1);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session(pose.name());
  matte.metadata.set_width_px(camera.width_px());
  matte.metadata.set_height_px(camera.height_px());
  v1::Monitor& of_pose = *matte.metadata.add_monitors();
  of_pose.set_name(monitor);
  of_pose.set_width_px(pose.width_px());
  of_pose.set_height_px(pose.height_px());
  for (int y = 0; y < camera.height_px(); ++y) {
    for (int x = camera.width_px() / 2; x < camera.width_px(); ++x) {
      matte.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 0.5f,
                                   .x_px = static_cast<float>(pose.width_px()) / 3.0f,
                                   .y_px = static_cast<float>(pose.height_px()) / 3.0f,
                                   .xx_px2 = 1.0f,
                                   .yy_px2 = 1.0f};
      }
    }
  }
  return matte;
}

}  // namespace

std::vector<std::string> seeds() {
  const std::string near = R"(monitors { name: "near" width_px: 64 height_px: 48 pitch_mm: 1
  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-32, -24, 200] residual_px: 0.1 }
)",
                    far = R"(monitors { name: "far" width_px: 64 height_px: 48 pitch_mm: 0.5
  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-16, -12, 250] }
)",
                    turned =
                        R"(monitors { name: "turned" monitor: "back" width_px: 64 height_px: 48 pitch_mm: 1
  rotation: [0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8] translation_mm: [-32, -24, 210] }
)";
  const std::string camera =
      "camera { width_px: 6 height_px: 4 fx_px: 8 fy_px: 8.5 cx_px: 3.1 cy_px: 2 k1: -0.06 }\n";
  return {
      camera + near + far, camera + near + turned, camera + turned + far + near,
      "camera { width_px: 6 height_px: 4 fx_px: 8 fy_px: 8 k1: 1e8 k2: -1e8 p1: 3 k3: 1e9 }\n" + near + far,
      "camera { width_px: 6 height_px: 4 fx_px: inf fy_px: 8 cx_px: nan }\n" + near};
}

void try_input(std::string_view input) {
  static const google::protobuf::LogSilencer silent;  // silences complaints about strings that are not UTF-8
  const absl::StatusOr<v1::RigGeometry> geometry = parse_geometry(input, "rig.txtpb");
  if (!geometry.ok()) {
    FUZZ_CHECK(geometry.status().message().find("rig.txtpb:") == 0);
    return;
  }
  for (const v1::MonitorPose& pose : geometry->monitors()) {
    const MonitorPlane plane(pose);
    FUZZ_CHECK(plane.at(pose.width_px(), pose.height_px()).allFinite());
    FUZZ_CHECK(plane.depth_mm() > 0.0);
  }
  constexpr int kMaxSide = 12;
  const v1::CameraGeometry& camera = geometry->camera();
  if (geometry->monitors_size() < 2 || std::max(camera.width_px(), camera.height_px()) > kMaxSide) return;
  const v1::MonitorPose &one = geometry->monitors(0), &other = geometry->monitors(1);
  const std::string monitor = one.monitor().empty() ? other.monitor() : one.monitor();
  const absl::StatusOr<RayMatte> rays =
      match_rays(seen_before(camera, one, monitor), seen_before(camera, other, monitor), *geometry,
                 {one.name(), other.name()});
  if (!rays.ok()) {
    FUZZ_CHECK(!rays.status().message().empty());
    return;
  }
  FUZZ_CHECK(decode_rays(encode_rays(*rays).value()).ok());
}

}  // namespace glasswing::fuzz
