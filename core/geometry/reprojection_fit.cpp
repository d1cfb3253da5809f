#include "core/geometry/reprojection_fit.h"

#include "core/base/status.h"
#include "core/process/module.h"

namespace glasswing {

Eigen::Vector2d Reprojection::residual_px(const SeenPoint& point) const {
  const Pose& pose = poses[point.pose];
  const Eigen::Vector3d x = pose.rotation.leftCols<2>() * point.at_mm + pose.translation_mm;
  if (!(x.z() > 0.0)) return Eigen::Vector2d::Constant(INFINITY);
  Eigen::Vector2d pixel;
  lens_pixel(lens.data(), x.x() / x.z(), x.y() / x.z(), pixel.data());
  return point.pixel - pixel;
}

absl::StatusOr<ReprojectionFit> fit_reprojection(Reprojection& problem, double huber_sd) {
  static const absl::StatusOr<const void*> kModule =
      load_module("glasswing-geometry.so", "glasswing_reprojection_solver");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const ReprojectionSolver*>(*kModule)->fit(problem, huber_sd);
}

}  // namespace glasswing
