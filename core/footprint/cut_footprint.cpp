#include "core/footprint/cut_footprint.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kMin_px2 = 1e-3;
constexpr double kFar = 8.0;  // standard deviations
constexpr double kNarrow_px2 = 0.36;

// -dg/dn f integrated along an edge, times sigma_s^2 + 1/12 and over f g's peak. The coordinate that the edge
// fixes is `at_px`, z standard deviations from the mean; the other one goes from low to high, in its own.
struct Edge {
  double z, at_px, own_sd_px, own_axis;    // the coordinate that the edge fixes
  double low, high, mean_px, sd_px, axis;  // the other one
};
double edge_light(const Edge& edge, const NormalCorners& corners, double r_px) {
  if (std::abs(edge.z) > kFar) return 0.0;
  // Along the edge, the other coordinate has mean rho z and standard deviation `rest`.
  const double rho = corners.rho, rest = corners.rest;
  const double from = (edge.low - rho * edge.z) / rest, to = (edge.high - rho * edge.z) / rest;
  const double part = normal_integral(to) - normal_integral(from);
  const double moment = (edge.mean_px + rho * edge.sd_px * edge.z) * part -
                        edge.sd_px * rest * (normal_density(to) - normal_density(from));
  return edge.own_axis * normal_density(edge.z) / edge.own_sd_px *
         ((edge.at_px * edge.own_axis - r_px) * part + edge.axis * moment);
}

}  // namespace

CutFootprint::CutFootprint(const Footprint& mode, const StripeAxis& axis, const MonitorExtent& extent)
    : cos_phi(axis.cos_phi),
      sin_phi(axis.sin_phi),
      centre_px(mode.x_px * axis.cos_phi + mode.y_px * axis.sin_phi),
      variance_px2(answered_variance(mode, axis)),
      sigma_px(std::sqrt(variance_px2)),
      stripe_variance_px2(axis.sigma_px * axis.sigma_px + kFlatPixel_px2),
      peak(axis.sigma_px / sigma_px),
      x_px(mode.x_px),
      y_px(mode.y_px),
      gx_px2(mode.xx_px2 * axis.cos_phi + mode.xy_px2 * axis.sin_phi),
      gy_px2(mode.xy_px2 * axis.cos_phi + mode.yy_px2 * axis.sin_phi),
      low_x_px(0.0),
      high_x_px(extent.width_px),
      low_y_px(0.0),
      high_y_px(extent.height_px),
      corners(0.0) {
  const double xx = mode.xx_px2 - gx_px2 * gx_px2 / variance_px2;
  const double yy = mode.yy_px2 - gy_px2 * gy_px2 / variance_px2;
  const double xy = mode.xy_px2 - gx_px2 * gy_px2 / variance_px2;
  clamped_x = xx <= kMin_px2;
  clamped_y = yy <= kMin_px2;
  sd_x_px = std::sqrt(std::max(xx, kMin_px2));
  sd_y_px = std::sqrt(std::max(yy, kMin_px2));
  mirrored = xy < 0.0;
  corners = NormalCorners(std::abs(xy) / (sd_x_px * sd_y_px));
  if (mirrored) {
    y_px = -y_px, gy_px2 = -gy_px2, sin_phi = -sin_phi;
    low_y_px = -extent.height_px, high_y_px = 0.0;
  }
}

double CutFootprint::answer(double r_px) const {
  const double offset = r_px - centre_px, pull = offset / variance_px2;
  const double whole = peak * std::exp(-0.5 * offset * pull);
  const double mx = x_px + gx_px2 * pull, my = y_px + gy_px2 * pull;
  const std::array<double, 2> low = {(low_x_px - mx) / sd_x_px, (low_y_px - my) / sd_y_px};
  const std::array<double, 2> high = {(high_x_px - mx) / sd_x_px, (high_y_px - my) / sd_y_px};
  double edges = 0.0;
  for (const double sign : {-1.0, 1.0}) {
    const std::array<double, 2>& at = sign < 0.0 ? low : high;
    const Edge x{at[0],  sign < 0.0 ? low_x_px : high_x_px, sd_x_px, cos_phi, low[1], high[1], my, sd_y_px,
                 sin_phi};
    const Edge y{at[1],  sign < 0.0 ? low_y_px : high_y_px, sd_y_px, sin_phi, low[0], high[0], mx, sd_x_px,
                 cos_phi};
    edges += sign * (edge_light(x, corners, r_px) + edge_light(y, corners, r_px));
  }
  return whole * (corners.share(low, high) + edges / (12.0 * stripe_variance_px2));
}

bool narrow(const Footprint& mode) {
  return mode.xx_px2 < kNarrow_px2 && mode.yy_px2 < kNarrow_px2;
}

std::vector<ReachedPixel> reached_pixels(const Footprint& mode, const MonitorExtent& extent) {
  // A point is a hundredth of a pixel wide, so that it has a density.
  const Footprint spread = with_positive_covariance(mode, 1e-4);
  const NormalDensity density{spread.x_px, spread.y_px, spread.xx_px2, spread.xy_px2, spread.yy_px2};
  const auto from = [](double centre, double variance) {
    return std::max(0.0, std::floor(centre - 5.0 * std::sqrt(variance)));
  };
  const auto to = [](double centre, double variance, double extent_px) {
    return std::min(extent_px, std::floor(centre + 5.0 * std::sqrt(variance)) + 1.0);
  };
  const double left = from(density.x, density.xx), top = from(density.y, density.yy);
  const int columns = static_cast<int>(std::ceil(to(density.x, density.xx, extent.width_px) - left)),
            rows = static_cast<int>(std::ceil(to(density.y, density.yy, extent.height_px) - top));
  std::vector<ReachedPixel> pixels;
  if (columns <= 0 || rows <= 0) return pixels;
  const std::vector<NormalShare> cells =
      NormalOnRectangles(density).cells(left, 1.0, columns, top, 1.0, rows);
  for (int i = 0; i < columns * rows; ++i)
    pixels.push_back({left + i % columns + 0.5, top + i / columns + 0.5, cells[i]});
  return pixels;
}

}  // namespace glasswing
