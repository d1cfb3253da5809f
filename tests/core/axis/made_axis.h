// A board on a turning table, seen by a camera, by equations written here and not those under test.
#pragma once

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/axis/axis_fit.h"
#include "tests/core/geometry/made_views.h"

namespace glasswing {

struct MadeTable {
  MadeCamera camera;
  Eigen::Vector3d direction = Eigen::Vector3d(0.05, 1.0, -0.12).normalized();
  Eigen::Vector3d point_mm{12.0, 8.0, 230.0};
  Eigen::Matrix3d board = MadePose{.yaw_deg = 10.0, .pitch_deg = -15.0, .roll_deg = 3.0}.rotation();
  Eigen::Vector3d board_mm{-20.0, -25.0, 215.0};  // of its corner at position 0
  double noise_px = 0.0, tip_deg = 0.0, shift_mm = 0.0;
};

inline std::vector<double> positions(double first, double last, int count) {
  std::vector<double> positions;
  for (int i = 0; i < count; ++i) positions.push_back(first + (last - first) * i / (count - 1));
  return positions;
}

inline std::vector<AxisSighting> sightings(const MadeTable& table, const std::vector<double>& positions_deg,
                                           std::uint64_t seed) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<AxisSighting> seen;
  const Eigen::Vector3d across_x = table.direction.unitOrthogonal(),
                        across_y = table.direction.cross(across_x);
  for (int i = 0; i < static_cast<int>(positions_deg.size()); ++i) {
    const Eigen::Vector3d tip =
        kDegree * table.tip_deg * (normal(random) * across_x + normal(random) * across_y);
    const Eigen::Vector3d shift =
        table.shift_mm * Eigen::Vector3d(normal(random), normal(random), normal(random));
    Eigen::Matrix3d turn = Eigen::AngleAxisd(positions_deg[i] * kDegree, table.direction).toRotationMatrix();
    if (tip.norm() > 0.0) turn = Eigen::AngleAxisd(tip.norm(), tip.normalized()) * turn;
    for (int y = 1; y < 6; ++y) {
      for (int x = 1; x < 8; ++x) {
        const Eigen::Vector3d at_mm(7.0 * x, 7.0 * y, 0.0);
        const Eigen::Vector3d at =
            table.point_mm + shift + turn * (table.board * at_mm + table.board_mm - table.point_mm);
        seen.push_back({.position = i,
                        .pixel = table.camera.pixel_of(at) +
                                 table.noise_px * Eigen::Vector2d(normal(random), normal(random)),
                        .at_mm = at_mm});
      }
    }
  }
  return seen;
}

inline v1::CameraGeometry geometry_of(const MadeCamera& camera) {
  v1::CameraGeometry geometry;
  geometry.set_width_px(camera.width_px);
  geometry.set_height_px(camera.height_px);
  geometry.set_fx_px(camera.fx);
  geometry.set_fy_px(camera.fy);
  geometry.set_cx_px(camera.cx);
  geometry.set_cy_px(camera.cy);
  geometry.set_k1(camera.k1);
  geometry.set_k2(camera.k2);
  geometry.set_p1(camera.p1);
  geometry.set_p2(camera.p2);
  geometry.set_k3(camera.k3);
  return geometry;
}

inline Eigen::Vector3d vector_of(const google::protobuf::RepeatedField<double>& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

// The errors of a fit in its own standard errors: two of the direction, two of the place, along the principal
// axes of either covariance.
inline std::vector<double> in_standard_errors(const v1::AxisGeometry& axis, const Eigen::Vector3d& direction,
                                              const Eigen::Vector3d& point_mm) {
  const Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> covariance(axis.covariance().data());
  const Eigen::Vector3d found = vector_of(axis.direction()), at = vector_of(axis.point_mm());
  const Eigen::Vector3d true_at = point_mm + direction * direction.dot(at - point_mm);
  std::vector<double> errors;
  for (const auto& [block, error] : {std::pair(0, Eigen::Vector3d(found - direction)), {3, at - true_at}}) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(covariance.block<3, 3>(block, block));
    for (int i = 1; i < 3; ++i)
      errors.push_back(error.dot(parts.eigenvectors().col(i)) / std::sqrt(parts.eigenvalues()[i]));
  }
  return errors;
}

}  // namespace glasswing
