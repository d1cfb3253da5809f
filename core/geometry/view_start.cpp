#include "core/geometry/view_start.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kRounds = 10;
constexpr double kMinResidual = 1e-4;  // of half of the picture's width
constexpr double kMinFocal = 0.3, kMaxFocal = 30.0;

}  // namespace

ViewStart start_of(const MonitorView& view, double pitch_mm, const PictureScale& picture) {
  const double half_px = 0.5 * view.width_px;
  const Vector2d middle_px(half_px, 0.5 * view.height_px);
  std::vector<double> weights(view.sightings.size(), 1.0);
  ViewStart start{.homography = Matrix3d::Identity(),
                  .width_mm = view.width_px * pitch_mm,
                  .height_mm = view.height_px * pitch_mm};
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (size_t i = 0; i < weights.size(); ++i) {
      const Vector3d m = ((view.sightings[i].monitor_px - middle_px) / half_px).homogeneous();
      const Vector2d q = (view.sightings[i].pixel - picture.middle_px) / picture.half_px;
      Eigen::Matrix<double, 2, 9> rows;
      rows << m.transpose(), Vector3d::Zero().transpose(), -q.x() * m.transpose(),
          Vector3d::Zero().transpose(), m.transpose(), -q.y() * m.transpose();
      normal += weights[i] * rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
    const Eigen::Matrix<double, 9, 1> h = solver.eigenvectors().col(0);
    start.homography = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
    for (size_t i = 0; i < weights.size(); ++i) {
      const Vector3d m = ((view.sightings[i].monitor_px - middle_px) / half_px).homogeneous();
      const Vector2d q = (view.sightings[i].pixel - picture.middle_px) / picture.half_px;
      const Vector3d at = start.homography * m;
      weights[i] = 1.0 / std::max((at.hnormalized() - q).norm(), kMinResidual) / (at.z() * at.z());
    }
  }
  if (start.homography(2, 2) < 0.0) start.homography = -start.homography;
  start.mirrored = start.homography.determinant() < 0.0;
  return start;
}

std::optional<double> focal_length_of(std::span<const ViewStart> views) {
  double products = 0.0, squares = 0.0;
  for (const ViewStart& view : views) {
    const Matrix3d h = view.homography / view.homography.leftCols<2>().norm();
    const Vector3d a = h.col(0), b = h.col(1);
    // a and b, divided by (f, f, 1), are perpendicular and equally long.
    const Vector2d unequal(a.x() * b.x() + a.y() * b.y(),
                           a.head<2>().squaredNorm() - b.head<2>().squaredNorm());
    const Vector2d by_depth(a.z() * b.z(), a.z() * a.z() - b.z() * b.z());
    products -= unequal.dot(by_depth);
    squares += by_depth.squaredNorm();
  }
  // f^2 by least squares: unequal / f^2 = -by_depth.
  const double focal_length = squares > 0.0 ? std::sqrt(products / squares) : NAN;
  if (!(focal_length > kMinFocal && focal_length < kMaxFocal)) return std::nullopt;
  return focal_length;
}

Reprojection::Pose pose_of(const ViewStart& view, double focal_length) {
  const Matrix3d axes = Vector3d(1.0 / focal_length, 1.0 / focal_length, 1.0).asDiagonal() * view.homography;
  const double scale = view.width_mm / (axes.col(0).norm() + axes.col(1).norm());  // of two halves
  Matrix3d guess;
  guess << axes.col(0), axes.col(1), axes.col(0).cross(axes.col(1)).normalized() * axes.col(0).norm();
  const Eigen::JacobiSVD<Matrix3d> svd(guess, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Reprojection::Pose pose;
  pose.rotation = svd.matrixU() * svd.matrixV().transpose();
  pose.translation_mm =
      scale * axes.col(2) - pose.rotation * Vector3d(0.5 * view.width_mm, 0.5 * view.height_mm, 0.0);
  return pose;
}

}  // namespace glasswing
