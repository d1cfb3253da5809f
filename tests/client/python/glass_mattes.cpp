// Mattes of a sphere of glass before two turned monitors at two depths, in closed form, and their geometry.
//
//   glass-mattes DIRECTORY    writes near.exr, far.exr, bare.exr (near, without the sphere) and rig.txtpb
//   glass-mattes DIRECTORY points    the same with footprints that are points, also as views
//                                    of cameras: vase.near.exr, of session vase.near, ...
//
// Monitors stand beside each other, turned by 20 degrees to either side, and tilted. A pixel's mode is where
// its middle's ray goes by Snell's law; the footprint's width and the standard errors (0.02 px near, 0.05 px
// far) are assumed.
#include <iostream>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/geometry/rig_geometry.h"
#include "core/matte/matte_file.h"
#include "tests/core/rays/snell.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 40, kHeight = 30, kMonitorWidth = 60, kMonitorHeight = 90;

v1::MonitorPose pose_of(const std::string& name, const std::string& monitor, double turn, double side,
                        double depth) {
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(turn, Vector3d::UnitY()) * Eigen::AngleAxisd(0.1, Vector3d::UnitX()))
          .toRotationMatrix();
  v1::MonitorPose pose;
  pose.set_name(name);
  pose.set_monitor(monitor);
  pose.set_width_px(kMonitorWidth);
  pose.set_height_px(kMonitorHeight);
  pose.set_pitch_mm(0.8);
  for (const double value : rotation.transpose().reshaped()) pose.add_rotation(value);  // row by row
  const Vector3d corner = Vector3d(side, 0.0, depth) - rotation * Vector3d(24.0, 36.0, 0.0);
  for (const double value : corner) pose.add_translation_mm(value);
  return pose;
}

v1::RigGeometry rig() {
  v1::RigGeometry made;
  v1::CameraGeometry& camera = *made.mutable_camera();
  camera.set_width_px(kWidth);
  camera.set_height_px(kHeight);
  camera.set_fx_px(60.0);
  camera.set_fy_px(61.0);
  camera.set_cx_px(19.0);
  camera.set_cy_px(15.5);
  camera.set_k1(-0.08);
  for (const auto& [name, depth] : {std::pair{"near", 200.0}, {"far", 250.0}}) {
    *made.add_monitors() = pose_of(name, "left", -0.35, -26.0, depth);
    *made.add_monitors() = pose_of(name, "right", 0.35, 26.0, depth);
  }
  return made;
}

std::optional<Vector2d> met(const snell::Line& line, const MonitorPlane& plane) {
  const double along = plane.normal.dot(plane.corner_mm - line.origin) / plane.normal.dot(line.direction);
  const Vector3d at = line.origin + along * line.direction - plane.corner_mm;
  const Vector2d px = Vector2d(plane.x_mm.dot(at), plane.y_mm.dot(at)) / (plane.pitch_mm * plane.pitch_mm);
  if (along < 0.0 || px.minCoeff() < 0.0 || px.x() > kMonitorWidth || px.y() > kMonitorHeight)
    return std::nullopt;
  return px;
}

// One mode of each pixel whose ray meets one monitor at both depths.
void see(const v1::RigGeometry& geometry, std::array<Matte, 2>& mattes) {
  const CameraLens lens(geometry.camera());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vector2d slope = lens.slope_of({x + 0.5, y + 0.5});
      const auto line =
          snell::through_sphere({Vector3d::Zero(), Vector3d(slope.x(), slope.y(), 1.0).normalized()},
                                {3.0, -2.0, 120.0}, 20.0, 1.5);
      if (!line) continue;
      for (int t = 0; t < 2; ++t) {
        const std::array<std::optional<Vector2d>, 2> places = {
            met(*line, MonitorPlane(geometry.monitors(t))),
            met(*line, MonitorPlane(geometry.monitors(2 + t)))};
        if (!places[0] || !places[1]) continue;
        for (size_t depth = 0; depth < 2; ++depth) {
          mattes[depth].coverage(x, y) = 1.0f;
          for (int c = 0; c < kChannels; ++c) {
            mattes[depth].modes(x, y, c)[0] = {.weight = 0.9f - 0.1f * static_cast<float>(c),
                                               .x_px = static_cast<float>(places[depth]->x()),
                                               .y_px = static_cast<float>(places[depth]->y()),
                                               .xx_px2 = 1.0f,
                                               .yy_px2 = 2.0f,
                                               .texture = t,
                                               .centre_sd_px = depth == 0 ? 0.02f : 0.05f};
          }
        }
        break;
      }
    }
  }
}

// Without the sphere: pixels see the near monitors straight.
Matte bare(const v1::RigGeometry& geometry) {
  const CameraLens lens(geometry.camera());
  Matte matte(0, 0, kWidth, kHeight, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vector2d slope = lens.slope_of({x + 0.5, y + 0.5});
      for (int t = 0; t < 2; ++t) {
        const auto at =
            met({Vector3d::Zero(), Vector3d(slope.x(), slope.y(), 1.0)}, MonitorPlane(geometry.monitors(t)));
        if (!at) continue;
        for (int c = 0; c < kChannels; ++c) {
          matte.modes(x, y, c)[0] = {.weight = 1.0f,
                                     .x_px = static_cast<float>(at->x()),
                                     .y_px = static_cast<float>(at->y()),
                                     .xx_px2 = 1.0f,
                                     .yy_px2 = 1.0f,
                                     .texture = t};
        }
      }
    }
  }
  return matte;
}

void narrow(Matte& matte) {
  for (int i = 0; i < kWidth * kHeight * kChannels; ++i) {
    Mode& mode = matte.modes(i / kChannels % kWidth, i / kChannels / kWidth, i % kChannels)[0];
    mode.xx_px2 = mode.yy_px2 = 0.0f;
  }
}

absl::Status write(const fs::path& directory, bool points) {
  const v1::RigGeometry geometry = rig();
  const std::array<const char*, 3> names = {"near", "far", "bare"};
  std::array<Matte, 2> seen = {Matte(0, 0, kWidth, kHeight, 1), Matte(0, 0, kWidth, kHeight, 1)};
  see(geometry, seen);
  std::array<Matte, 3> mattes = {std::move(seen[0]), std::move(seen[1]), bare(geometry)};
  for (size_t depth = 0; depth < mattes.size(); ++depth) {
    if (points) narrow(mattes[depth]);
    v1::MatteMetadata& metadata = mattes[depth].metadata;
    metadata.set_format_version(1);
    metadata.set_session(names[depth]);
    metadata.set_width_px(kWidth);
    metadata.set_height_px(kHeight);
    for (const char* name : {"left", "right"}) {
      v1::Monitor& monitor = *metadata.add_monitors();
      monitor.set_name(name);
      monitor.set_width_px(kMonitorWidth);
      monitor.set_height_px(kMonitorHeight);
    }
    GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(mattes[depth]));
    GW_RETURN_IF_ERROR(write_file_durably(directory / (std::string(names[depth]) + ".exr"), bytes));
    if (!points) continue;
    metadata.set_session(std::string("vase.") + names[depth]);
    GW_ASSIGN_OR_RETURN(const std::string view, encode_matte(mattes[depth]));
    GW_RETURN_IF_ERROR(write_file_durably(directory / (metadata.session() + ".exr"), view));
  }
  return write_file_durably(directory / "rig.txtpb", geometry_text(geometry));
}

}  // namespace
}  // namespace glasswing

int main(int count, char** words) {
  if (count != 2 && count != 3) {
    std::cerr << "usage: glass-mattes DIRECTORY [points]\n";
    return 2;
  }
  const absl::Status written = glasswing::write(words[1], count == 3);
  if (!written.ok()) std::cerr << written << "\n";
  return written.ok() ? 0 : 1;
}
