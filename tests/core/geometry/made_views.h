// Views of a flat monitor through a lens, by equations written here and not those under test.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/geometry/monitor_sightings.h"

namespace glasswing {

// A lens, Brown's, and a picture of 640x480.
struct MadeCamera {
  double fx = 820.0, fy = 815.0, cx = 331.0, cy = 228.0;
  double k1 = -0.21, k2 = 0.09, p1 = 0.0011, p2 = -0.0008, k3 = 0.0;
  int width_px = 640, height_px = 480;

  Eigen::Vector2d pixel_of(const Eigen::Vector3d& at) const {
    const double x = at[0] / at[2], y = at[1] / at[2], r2 = x * x + y * y;
    const double radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    const double xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const double yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    return {fx * xd + cx, fy * yd + cy};
  }
  // The direction (x, y, 1) of a pixel, by Newton's method with differences.
  Eigen::Vector3d direction_of(const Eigen::Vector2d& pixel) const {
    Eigen::Vector3d at((pixel[0] - cx) / fx, (pixel[1] - cy) / fy, 1.0);
    for (int i = 0; i < 20; ++i) {
      constexpr double kStep = 1e-6;
      const Eigen::Vector2d here = pixel_of(at);
      Eigen::Matrix2d slope;
      slope << (pixel_of(at + Eigen::Vector3d(kStep, 0, 0)) - here) / kStep,
          (pixel_of(at + Eigen::Vector3d(0, kStep, 0)) - here) / kStep;
      at.head<2>() += slope.inverse() * (pixel - here);
    }
    return at;
  }
};

// Of a monitor whose middle stands at `middle_mm`, turned about the vertical, the horizontal and its own
// axis.
struct MadePose {
  double yaw_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0;
  Eigen::Vector3d middle_mm{0.0, 0.0, 600.0};

  Eigen::Matrix3d rotation() const {
    const auto rad = [](double deg) { return deg * std::numbers::pi / 180.0; };
    const double a = rad(yaw_deg), b = rad(pitch_deg), c = rad(roll_deg);
    Eigen::Matrix3d yaw, pitch, roll;
    yaw << std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a);
    pitch << 1, 0, 0, 0, std::cos(b), -std::sin(b), 0, std::sin(b), std::cos(b);
    roll << std::cos(c), -std::sin(c), 0, std::sin(c), std::cos(c), 0, 0, 0, 1;
    return yaw * pitch * roll;
  }
};

struct MadeMonitor {
  int width_px = 1920, height_px = 1080;
  double pitch_mm = 0.2745;

  Eigen::Vector3d corner_mm(const MadePose& pose) const {
    return pose.middle_mm -
           pose.rotation() * Eigen::Vector3d(width_px * pitch_mm / 2, height_px * pitch_mm / 2, 0);
  }
};

// Where a pixel's ray meets the monitor, its px; may lie beyond its edges.
inline Eigen::Vector2d looked_at(const MadeCamera& camera, const MadeMonitor& monitor, const MadePose& pose,
                                 const Eigen::Vector2d& pixel) {
  const Eigen::Matrix3d rotation = pose.rotation();
  const Eigen::Vector3d corner = monitor.corner_mm(pose), ray = camera.direction_of(pixel);
  const Eigen::Vector3d at = ray * (rotation.col(2).dot(corner) / rotation.col(2).dot(ray));
  return (rotation.transpose() * (at - corner)).head<2>() / monitor.pitch_mm;
}

// The points of a grid on the monitor that fall into the picture, and where. `noise_px`: along either axis.
inline MonitorView made_view(const MadeCamera& camera, const MadeMonitor& monitor, const MadePose& pose,
                             const std::string& session, double noise_px, std::mt19937& random,
                             int columns = 24) {
  std::normal_distribution<double> normal(0.0, 1.0);
  MonitorView view{.session = session,
                   .monitor = "back",
                   .width_px = monitor.width_px,
                   .height_px = monitor.height_px,
                   .sightings = {}};
  const Eigen::Matrix3d rotation = pose.rotation();
  const Eigen::Vector3d corner = monitor.corner_mm(pose);
  const double step = static_cast<double>(monitor.width_px) / columns;
  for (double v = step / 2; v < monitor.height_px; v += step) {
    for (double u = step / 2; u < monitor.width_px; u += step) {
      const Eigen::Vector3d at =
          rotation * Eigen::Vector3d(u * monitor.pitch_mm, v * monitor.pitch_mm, 0) + corner;
      Eigen::Vector2d pixel = camera.pixel_of(at);
      if (pixel[0] < 0 || pixel[0] > camera.width_px || pixel[1] < 0 || pixel[1] > camera.height_px) continue;
      pixel += noise_px * Eigen::Vector2d(normal(random), normal(random));
      view.sightings.push_back({.pixel = pixel, .monitor_px = {u, v}, .sd_px = 0.1});
    }
  }
  return view;
}

// Ten turns of both signs about both axes, that fill the picture.
inline std::vector<MadePose> good_poses() {
  return {{0, 0, 0, {0, 0, 520}},      {25, 0, 2, {20, 5, 560}},    {-25, 3, 0, {-30, 0, 540}},
          {4, 28, -3, {0, -20, 580}},  {0, -27, 0, {10, 25, 550}},  {20, 20, 5, {30, 10, 600}},
          {-22, 18, -4, {0, 15, 560}}, {-18, -24, 0, {-10, 0, 540}}};
}

}  // namespace glasswing
