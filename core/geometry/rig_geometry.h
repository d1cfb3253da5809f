// The poses of a camera and monitors: the file, the lens and the planes. proto/glasswing/v1/rays.proto has
// the conventions; lengths are mm, in the camera's frame.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/geometry/lens.h"
#include "glasswing/v1/rays.pb.h"

namespace glasswing {

// Protobuf text. INVALID_ARGUMENT names the file, and the line or the value.
absl::StatusOr<v1::RigGeometry> parse_geometry(std::string_view text, std::string_view file_name);
absl::StatusOr<v1::RigGeometry> read_geometry(const std::filesystem::path& path);
std::string geometry_text(const v1::RigGeometry& geometry);
absl::Status check_geometry(const v1::RigGeometry& geometry);

// The pose of this name and monitor. NOT_FOUND lists the existing ones.
absl::StatusOr<const v1::MonitorPose*> find_pose(const v1::RigGeometry& geometry, std::string_view name,
                                                 std::string_view monitor);

// The camera of a picture with one of `step` x `step` pixels, starting with the first, each of the original
// size: pixel i of it is i * step. Without standard errors.
v1::CameraGeometry sampled_camera(const v1::CameraGeometry& camera, int step);

class CameraLens {
 public:
  explicit CameraLens(const v1::CameraGeometry& camera);
  // The distortion of u = (X/Z, Y/Z), and its inverse to about 1e-12; continuous px.
  Eigen::Vector2d pixel_of(const Eigen::Vector2d& u) const;
  Eigen::Vector2d slope_of(const Eigen::Vector2d& pixel) const;

 private:
  std::array<double, kLensNumbers> numbers_;
};

// The plane of a monitor's pixels.
struct MonitorPlane {
  Eigen::Vector3d corner_mm, x_mm, y_mm;  // of pixel coordinates (0, 0); of a pixel along x and y
  Eigen::Vector3d normal;                 // away from the camera's side: x cross y, a unit
  double pitch_mm = 1.0;

  explicit MonitorPlane(const v1::MonitorPose& pose);
  Eigen::Vector3d at(double x_px, double y_px) const { return corner_mm + x_px * x_mm + y_px * y_mm; }
  // Moved along its normal to this distance from the camera, measured along the normal.
  MonitorPlane at_depth(double depth_mm) const;
  double depth_mm() const { return normal.dot(corner_mm); }
};

}  // namespace glasswing
