#include "solver/footprint/footprint.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

// The share of a Gaussian on [0, extent].
double part_within(double mean, double variance, double extent) {
  const double scale = 1.0 / std::sqrt(2.0 * std::max(variance, 1e-6));
  return 0.5 * (std::erf((extent - mean) * scale) + std::erf(mean * scale));
}

}  // namespace

void Footprints::remove(int i) {
  std::move(begin() + i + 1, end(), begin() + i);
  --size_;
}

Mode mode_of(const Footprint& footprint, double weight_sd, double centre_sd_px, int texture) {
  const auto known = [](double sd) { return std::isfinite(sd) ? static_cast<float>(sd) : 0.0f; };
  return {.weight = static_cast<float>(footprint.weight),
          .x_px = static_cast<float>(footprint.x_px),
          .y_px = static_cast<float>(footprint.y_px),
          .xx_px2 = static_cast<float>(footprint.xx_px2),
          .xy_px2 = static_cast<float>(footprint.xy_px2),
          .yy_px2 = static_cast<float>(footprint.yy_px2),
          .texture = texture,
          .weight_sd = known(weight_sd),
          .centre_sd_px = known(centre_sd_px)};
}

double answered_variance(const Footprint& mode, const StripeAxis& axis) {
  const double c = axis.cos_phi, s = axis.sin_phi;
  return c * c * mode.xx_px2 + 2.0 * c * s * mode.xy_px2 + s * s * mode.yy_px2 +
         axis.sigma_px * axis.sigma_px + kFlatPixel_px2;
}

double response(const Footprint& mode, const StripeAxis& axis, double r_px, const MonitorExtent& extent) {
  const double variance = answered_variance(mode, axis);
  const double offset = r_px - mode.x_px * axis.cos_phi - mode.y_px * axis.sin_phi;
  const double whole =
      mode.weight * axis.sigma_px / std::sqrt(variance) * std::exp(-0.5 * offset * offset / variance);
  if (!near_edge(mode, extent)) return whole;
  const double gx = mode.xx_px2 * axis.cos_phi + mode.xy_px2 * axis.sin_phi;
  const double gy = mode.xy_px2 * axis.cos_phi + mode.yy_px2 * axis.sin_phi;
  const double pull = offset / variance;
  return whole * part_within(mode.x_px + gx * pull, mode.xx_px2 - gx * gx / variance, extent.width_px) *
         part_within(mode.y_px + gy * pull, mode.yy_px2 - gy * gy / variance, extent.height_px);
}

bool near_edge(const Footprint& mode, const MonitorExtent& extent) {
  const double reach_x = 4.0 * std::sqrt(std::max(mode.xx_px2, 0.0)) + 0.5;
  const double reach_y = 4.0 * std::sqrt(std::max(mode.yy_px2, 0.0)) + 0.5;
  return mode.x_px < reach_x || mode.y_px < reach_y || mode.x_px > extent.width_px - reach_x ||
         mode.y_px > extent.height_px - reach_y;
}

Footprint with_positive_covariance(Footprint mode, double min_px2) {
  const double mean = 0.5 * (mode.xx_px2 + mode.yy_px2);
  const double half = 0.5 * (mode.xx_px2 - mode.yy_px2);
  const double radius = std::hypot(half, mode.xy_px2);
  if (mean - radius >= min_px2) return mode;
  const double high = std::max(mean + radius, min_px2), low = std::max(mean - radius, min_px2);
  const double scale = radius > 0.0 ? 0.5 * (high - low) / radius : 0.0;
  mode.xx_px2 = 0.5 * (high + low) + scale * half;
  mode.yy_px2 = 0.5 * (high + low) - scale * half;
  mode.xy_px2 *= scale;
  return mode;
}

Footprint intersect(std::span<const StripeAxis> axes, std::span<const Peak> peaks, double* distance_px) {
  Eigen::Matrix2d lines = Eigen::Matrix2d::Zero();
  Eigen::Vector2d towards = Eigen::Vector2d::Zero();
  Eigen::Matrix3d widths = Eigen::Matrix3d::Zero();
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for (size_t i = 0; i < axes.size(); ++i) {
    const double c = axes[i].cos_phi, s = axes[i].sin_phi, sigma = axes[i].sigma_px;
    const Eigen::Vector2d axis(c, s);
    lines += axis * axis.transpose();
    towards += peaks[i].centre_px * axis;
    const Eigen::Vector3d square(c * c, 2.0 * c * s, s * s);
    widths += square * square.transpose();
    seen += (peaks[i].sigma_px * peaks[i].sigma_px - sigma * sigma - kFlatPixel_px2) * square;
    weight += peaks[i].amplitude * peaks[i].sigma_px / sigma / static_cast<double>(axes.size());
  }
  const Eigen::Vector2d centre = lines.inverse() * towards;
  const Eigen::Vector3d sigma = widths.inverse() * seen;
  if (distance_px != nullptr) {
    double squares = 0.0;
    for (size_t i = 0; i < axes.size(); ++i) {
      const double miss = centre.x() * axes[i].cos_phi + centre.y() * axes[i].sin_phi - peaks[i].centre_px;
      squares += miss * miss;
    }
    *distance_px = std::sqrt(squares / static_cast<double>(axes.size()));
  }
  return with_positive_covariance({.weight = weight,
                                   .x_px = centre.x(),
                                   .y_px = centre.y(),
                                   .xx_px2 = sigma[0],
                                   .xy_px2 = sigma[1],
                                   .yy_px2 = sigma[2]},
                                  0.01);
}

}  // namespace glasswing
