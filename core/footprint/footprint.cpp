#include "core/footprint/footprint.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/footprint/cut_footprint.h"
#include "core/footprint/normal_rectangle.h"

namespace glasswing {

void Footprints::remove(int i) {
  std::move(begin() + i + 1, end(), begin() + i);
  --size_;
}

MonitorExtent extent_of(const v1::Monitor& monitor) {
  return {.width_px = static_cast<double>(monitor.width_px()),
          .height_px = static_cast<double>(monitor.height_px())};
}

Footprint footprint_of(const Mode& mode) {
  return {.weight = mode.weight,
          .x_px = mode.x_px,
          .y_px = mode.y_px,
          .xx_px2 = mode.xx_px2,
          .xy_px2 = mode.xy_px2,
          .yy_px2 = mode.yy_px2};
}

Mode mode_of(const Footprint& footprint, double weight_sd, double centre_sd_px, int texture) {
  constexpr double kUnknown = 1e9;  // what is known no better than that is not known
  const auto known = [](double sd) { return sd < kUnknown ? static_cast<float>(sd) : 0.0f; };
  return {.weight = static_cast<float>(footprint.weight),
          .x_px = static_cast<float>(footprint.x_px),
          .y_px = static_cast<float>(footprint.y_px),
          .xx_px2 = static_cast<float>(std::max(footprint.xx_px2, 0.0)),  // rounding may fall below no width
          .xy_px2 = static_cast<float>(footprint.xy_px2),
          .yy_px2 = static_cast<float>(std::max(footprint.yy_px2, 0.0)),
          .texture = texture,
          .weight_sd = known(weight_sd),
          .centre_sd_px = known(centre_sd_px)};
}

SeenAxis seen_through_pixels(double centre_px, double variance_px2) {
  constexpr double kWide_px2 = 0.7, kMin_px2 = 1e-4, kReach = 6.0;
  if (variance_px2 > kWide_px2) return {centre_px, variance_px2, 1.0, 0.0, 0.0, 1.0};
  const double sigma = std::sqrt(std::max(variance_px2, kMin_px2));
  // Moments about the pixel of the centre, as sums over the edges of pixels that light lies beyond.
  const double middle = std::floor(centre_px) + 0.5;
  double mean = 0.0, square = 0.0, mean_by_centre = 0.0, square_by_centre = 0.0, mean_by_variance = 0.0,
         square_by_variance = 0.0;
  for (double edge = std::floor(centre_px - kReach * sigma) + 1.0; edge < centre_px + kReach * sigma;
       ++edge) {
    const double z = (edge - centre_px) / sigma, density = normal_density(z) / sigma;
    const bool after = edge > middle;
    // From the pixel before the edge to the one after it, or the other way round.
    const double beyond = normal_integral(after ? -z : z), sign = after ? 1.0 : -1.0;
    const double place = edge - middle + 0.5 * sign;  // of the pixel beyond
    const double square_step = place * place - (place - sign) * (place - sign);
    mean += sign * beyond;
    square += square_step * beyond;
    mean_by_centre += density;
    square_by_centre += sign * square_step * density;
    mean_by_variance += 0.5 * density * z / sigma;
    square_by_variance += sign * square_step * 0.5 * density * z / sigma;
  }
  if (variance_px2 < kMin_px2) mean_by_variance = square_by_variance = 0.0;
  return {.centre_px = middle + mean,
          .variance_px2 = square - mean * mean - kFlatPixel_px2,
          .centre_by_centre = mean_by_centre,
          .centre_by_variance = mean_by_variance,
          .variance_by_centre = square_by_centre - 2.0 * mean * mean_by_centre,
          .variance_by_variance = square_by_variance - 2.0 * mean * mean_by_variance};
}

Footprint seen_through_pixels(const Footprint& mode) {
  return seen_through_pixels(mode, seen_through_pixels(mode.x_px, mode.xx_px2),
                             seen_through_pixels(mode.y_px, mode.yy_px2));
}

Footprint seen_through_pixels(const Footprint& mode, const SeenAxis& x, const SeenAxis& y) {
  // Stein's lemma: the covariance of functions of normal variables is that of the variables times the means
  // of the derivatives, to first order.
  return {.weight = mode.weight,
          .x_px = x.centre_px,
          .y_px = y.centre_px,
          .xx_px2 = x.variance_px2,
          .xy_px2 = mode.xy_px2 * x.centre_by_centre * y.centre_by_centre,
          .yy_px2 = y.variance_px2};
}

double answered_variance(const Footprint& mode, const StripeAxis& axis) {
  const double c = axis.cos_phi, s = axis.sin_phi;
  return c * c * mode.xx_px2 + 2.0 * c * s * mode.xy_px2 + s * s * mode.yy_px2 +
         axis.sigma_px * axis.sigma_px + kFlatPixel_px2;
}

double response(const Footprint& mode, const StripeAxis& axis, double r_px, const MonitorExtent& extent) {
  if (near_edge(mode, extent)) {
    if (!narrow(mode)) return mode.weight * CutFootprint(mode, axis, extent).answer(r_px);
    double share = 0.0;
    for (const ReachedPixel& pixel : reached_pixels(mode, extent)) {
      const double offset = pixel.x_px * axis.cos_phi + pixel.y_px * axis.sin_phi - r_px;
      share += pixel.part.share * std::exp(-0.5 * offset * offset / (axis.sigma_px * axis.sigma_px));
    }
    return mode.weight * share;
  }
  const Footprint seen = seen_through_pixels(mode);
  const double variance = answered_variance(seen, axis);
  const double offset = r_px - seen.x_px * axis.cos_phi - seen.y_px * axis.sin_phi;
  return mode.weight * axis.sigma_px / std::sqrt(variance) * std::exp(-0.5 * offset * offset / variance);
}

bool near_edge(const Footprint& mode, const MonitorExtent& extent) {
  const double reach_x = 4.0 * std::sqrt(std::max(mode.xx_px2, 0.0)) + 0.5;
  const double reach_y = 4.0 * std::sqrt(std::max(mode.yy_px2, 0.0)) + 0.5;
  return mode.x_px < reach_x || mode.y_px < reach_y || mode.x_px > extent.width_px - reach_x ||
         mode.y_px > extent.height_px - reach_y;
}

Footprint with_positive_covariance(Footprint mode, double min_px2) {
  const Covariance positive = with_min_variance(covariance_of(mode), min_px2);
  mode.xx_px2 = positive.xx;
  mode.xy_px2 = positive.xy;
  mode.yy_px2 = positive.yy;
  return mode;
}

std::array<Footprint, 2> split(const Footprint& mode, SplitAxis axis) {
  constexpr double kMinVariance_px2 = 0.05, kShift = 0.8, kTaken = 0.6;
  const AxisVariances own = axis_variances(covariance_of(mode));
  const double angle =
      wide_axis_rad(covariance_of(mode)) + (axis == SplitAxis::kWide ? 0.0 : 0.5 * std::numbers::pi);
  const double variance = std::max(axis == SplitAxis::kWide ? own.wide : own.narrow, kMinVariance_px2);
  const double shift = kShift * std::sqrt(variance), less = kTaken * variance, x = std::cos(angle),
               y = std::sin(angle);
  Footprint half = mode;
  half.weight *= 0.5;
  half.xx_px2 -= less * x * x;
  half.xy_px2 -= less * x * y;
  half.yy_px2 -= less * y * y;
  half = with_positive_covariance(half, kMinVariance_px2);
  Footprint other = half;
  half.x_px += shift * x, half.y_px += shift * y;
  other.x_px -= shift * x, other.y_px -= shift * y;
  return {half, other};
}

Intersection intersect(std::span<const StripeAxis> axes, std::span<const Peak> peaks) {
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
  double squares = 0.0;
  for (size_t i = 0; i < axes.size(); ++i) {
    const double miss = centre.x() * axes[i].cos_phi + centre.y() * axes[i].sin_phi - peaks[i].centre_px;
    squares += miss * miss;
  }
  return {.mode = with_positive_covariance({.weight = weight,
                                            .x_px = centre.x(),
                                            .y_px = centre.y(),
                                            .xx_px2 = sigma[0],
                                            .xy_px2 = sigma[1],
                                            .yy_px2 = sigma[2]},
                                           0.01),
          .distance_px = std::sqrt(squares / static_cast<double>(axes.size()))};
}

}  // namespace glasswing
