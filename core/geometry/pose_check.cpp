#include "core/geometry/pose_check.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/geometry/rig_geometry.h"

namespace glasswing {
namespace {

using Motion = Eigen::Matrix<double, 6, 1>;  // turn (rad), shift (mm)

constexpr int kMaxSteps = 50;
constexpr double kEnd = 1e-10;     // of a step
constexpr double kHuber_px = 0.3;  // sightings beside an object's edge may be off by pixels

class MovedMonitor {
 public:
  MovedMonitor(const v1::CameraGeometry& camera, const v1::MonitorPose& pose, const MonitorView& view)
      : lens_(camera),
        plane_(pose),
        view_(view),
        middle_(plane_.at(0.5 * view.width_px, 0.5 * view.height_px)) {}

  Eigen::Vector2d pixel_of(const Sighting& sighting, const Motion& motion) const {
    const Eigen::Vector3d turn = motion.head<3>(), shift = motion.tail<3>();
    const Eigen::Vector3d arm = plane_.at(sighting.monitor_px.x(), sighting.monitor_px.y()) - middle_;
    const double angle = turn.norm();
    const Eigen::Vector3d turned =
        angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle) * arm : Eigen::Vector3d(arm);
    const Eigen::Vector3d place = turned + middle_ + shift;
    return lens_.pixel_of(place.head<2>() / place.z());
  }

  Motion step(const Motion& motion) const {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Motion gradient = Motion::Zero();
    for (const Sighting& sighting : view_.sightings) {
      const Eigen::Vector2d off = pixel_of(sighting, motion) - sighting.pixel;
      const double weight = std::min(1.0, kHuber_px / std::max(off.norm(), 1e-12));
      Eigen::Matrix<double, 2, 6> slope;
      for (int i = 0; i < 6; ++i) {
        const Motion delta = (i < 3 ? 1e-6 : 1e-6 * middle_.norm()) * Motion::Unit(i);
        slope.col(i) =
            (pixel_of(sighting, motion + delta) - pixel_of(sighting, motion - delta)) / (2.0 * delta(i));
      }
      normal += weight * slope.transpose() * slope;
      gradient += weight * slope.transpose() * off;
    }
    return normal.ldlt().solve(-gradient);
  }

  PoseCheck result(const Motion& motion) const {
    double squares = 0.0;
    std::vector<double> scatter;
    for (const Sighting& sighting : view_.sightings) {
      squares += (pixel_of(sighting, motion) - pixel_of(sighting, Motion::Zero())).squaredNorm();
      scatter.push_back((pixel_of(sighting, motion) - sighting.pixel).norm());
    }
    return {.off_px = std::sqrt(squares / static_cast<double>(view_.sightings.size())),
            .scatter_px = median(scatter),
            .shift_mm = motion.tail<3>().norm(),
            .away_mm = motion(5),
            .turn_deg = motion.head<3>().norm() * 180.0 / std::numbers::pi};
  }

 private:
  const CameraLens lens_;
  const MonitorPlane plane_;
  const MonitorView& view_;
  const Eigen::Vector3d middle_;
};

}  // namespace

absl::StatusOr<PoseCheck> check_pose(const v1::CameraGeometry& camera, const v1::MonitorPose& pose,
                                     const MonitorView& view) {
  if (pose.width_px() != view.width_px || pose.height_px() != view.height_px) {
    return absl::InvalidArgumentError(fmt::format(
        "monitor \"{}\" of session {} has {}x{} px, that of pose \"{}\" {}x{}", view.monitor, view.session,
        view.width_px, view.height_px, pose.name(), pose.width_px(), pose.height_px()));
  }
  const MovedMonitor monitor(camera, pose, view);
  Motion motion = Motion::Zero();
  for (int i = 0; i < kMaxSteps; ++i) {
    const Motion step = monitor.step(motion);
    motion += step;
    if (!motion.allFinite()) break;
    if (step.head<3>().norm() + step.tail<3>().norm() / MonitorPlane(pose).depth_mm() < kEnd)
      return monitor.result(motion);
  }
  return absl::FailedPreconditionError(fmt::format(
      "no pose of monitor \"{}\" near \"{}\" fits what the pixels of session {} see; it has moved far: "
      "calibrate again",
      view.monitor, pose.name(), view.session));
}

}  // namespace glasswing
