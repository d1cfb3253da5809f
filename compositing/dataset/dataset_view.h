// One view of a data set: a matte, where its monitors stood, and how the object was turned.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/geometry/rig_geometry.h"
#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

struct DatasetView {
  std::string name;  // of the session, which names files
  Matte matte;
  v1::CameraGeometry camera;
  std::vector<MonitorPlane> monitors;  // by texture
  // Of their poses, as MonitorPose.covariance; 0: not known.
  std::vector<Eigen::Matrix<double, 6, 6>> pose_covariances;
  Eigen::Matrix4d object_to_camera = Eigen::Matrix4d::Identity();
};

// The file of `glasswing poses` (core/axis/object_pose.h): {"object_to_rig": {NAME: 4x4}}, mm.
// INVALID_ARGUMENT names the pose that is not a rigid motion.
using ObjectPoses = std::map<std::string, Eigen::Matrix4d>;
absl::StatusOr<ObjectPoses> read_object_poses(const std::string& file);

// Where each pixel's light came from: the centre of its channel's strongest mode, together with those beside
// it, on an object corrected for what the pixel's size does to it (point_errors.h).
struct ScreenPoints {
  std::vector<std::uint8_t> known;     // by pixel: 1 where the others have a value
  std::vector<Eigen::Vector3d> at_mm;  // camera's frame
  std::vector<Eigen::Vector2d> at_px;
  std::vector<float> sd_mm;  // standard error of one of two axes, 0: not known
};
// Known where these have at least half of the channel's light, its centre is on its monitor, and the pixel
// has no flag. `object`: of pixels that the object covers completely, or of those beside it, whose standard
// errors are those of the fit alone.
ScreenPoints screen_points(const DatasetView& view, int channel, bool object);

// The picture of a pinhole camera instead of the view's lens, of the same matrix. Without distortion nothing
// changes; otherwise values are interpolated, and points known where the four around them are and belong
// together: within kTogether_px of each other, without a step of kStep_px in the second difference.
inline constexpr double kTogether_px = 8.0, kStep_px = 0.5;
bool has_distortion(const v1::CameraGeometry& camera);
RadianceImage undistorted(const v1::CameraGeometry& camera, const RadianceImage& picture);
ScreenPoints undistorted(const v1::CameraGeometry& camera, const ScreenPoints& points);

RadianceImage coverage_of(const Matte& matte);  // of one channel

// [fx 0 cx; 0 fy cy; 0 0 1]; `centre`: the coordinate of the first pixel's centre, 0.5 or 0.
Eigen::Matrix3d camera_matrix(const v1::CameraGeometry& camera, double centre);

}  // namespace glasswing
