#include "core/footprint/normal_rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/footprint/gauss_legendre.h"

namespace glasswing {
namespace {

constexpr double kFarCorner = 5.5;  // standard deviations: e(t) < 3e-7
constexpr double kMaxRho = 0.99999;

constexpr double kFourSuffice = 0.5, kSixSuffice = 0.9, kTenSuffice = 0.98, kSteep = 0.998;  // rho

const GaussLegendre<4> kFour;
const GaussLegendre<6> kSix;
const GaussLegendre<10> kTen;
const GaussLegendre<16> kSixteen;

}  // namespace

double normal_integral(double z) {
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double normal_density(double z) {
  return std::numbers::inv_sqrtpi / std::numbers::sqrt2 * std::exp(-0.5 * z * z);
}

NormalCorners::NormalCorners(double correlation)
    : rho(std::min(correlation, kMaxRho)), rest(std::sqrt(1.0 - rho * rho)), steep(rho > kSteep) {
  const double bound = std::asin(rho), first = steep ? bound : 0.0,
               last = steep ? std::numbers::pi / 2.0 : bound;
  const auto place_nodes = [&](const auto& rule) {
    node_count = rule.place.size();
    for (size_t i = 0; i < node_count; ++i) {
      sine[i] = std::sin(0.5 * (first + last) + 0.5 * (last - first) * rule.place[i]);
      scale[i] = 0.5 / (1.0 - sine[i] * sine[i]);
      weight[i] = rule.weight[i] * 0.25 * (last - first) / std::numbers::pi * (steep ? -1.0 : 1.0);
    }
  };
  if (rho <= kFourSuffice)
    place_nodes(kFour);
  else if (rho <= kSixSuffice)
    place_nodes(kSix);
  else if (rho <= kTenSuffice)
    place_nodes(kTen);
  else
    place_nodes(kSixteen);
}

double NormalCorners::share(const std::array<double, 2>& low, const std::array<double, 2>& high) const {
  double share = steep ? 0.0
                       : (normal_integral(high[0]) - normal_integral(low[0])) *
                             (normal_integral(high[1]) - normal_integral(low[1]));
  for (const double sign_h : {-1.0, 1.0}) {
    for (const double sign_k : {-1.0, 1.0}) {
      const double h = sign_h < 0.0 ? low[0] : high[0], k = sign_k < 0.0 ? low[1] : high[1];
      const double sign = sign_h * sign_k;
      if (steep) share += sign * normal_integral(std::min(h, k));
      if (std::abs(h) > kFarCorner || std::abs(k) > kFarCorner) continue;
      for (size_t n = 0; n < node_count; ++n)
        share += sign * weight[n] * std::exp(-(h * h + k * k - 2.0 * h * k * sine[n]) * scale[n]);
    }
  }
  return share;
}

NormalOnRectangles::NormalOnRectangles(const NormalDensity& density)
    : density_(density),
      sd_x_(std::sqrt(density.xx)),
      sd_y_(std::sqrt(density.yy)),
      turn_(density.xy < 0.0 ? -1.0 : 1.0),
      corners_(turn_ * density.xy / (sd_x_ * sd_y_)) {}

NormalShare NormalOnRectangles::share(const Rectangle& rectangle) const {
  const NormalDensity& density = density_;
  const double sd_x = sd_x_, sd_y = sd_y_, turn = turn_;
  const NormalCorners& corners = corners_;
  const double rho = corners.rho, rest = corners.rest;
  const std::array<double, 2> x = {(rectangle.left - density.x) / sd_x, (rectangle.right - density.x) / sd_x};
  std::array<double, 2> y = {(rectangle.top - density.y) / sd_y, (rectangle.bottom - density.y) / sd_y};
  if (turn < 0.0) y = {-y[1], -y[0]};
  // The density on each edge, where the other coordinate has mean rho z and standard deviation `rest`.
  double line_x = 0.0, line_y = 0.0, slope_x = 0.0, slope_y = 0.0, at_corners = 0.0;
  for (size_t i = 0; i < 2; ++i) {
    const double sign = i == 0 ? -1.0 : 1.0;
    const double low = (y[0] - rho * x[i]) / rest, high = (y[1] - rho * x[i]) / rest;
    const double on_x = sign * normal_density(x[i]) * (normal_integral(high) - normal_integral(low));
    line_x += on_x;
    slope_x += x[i] * on_x;
    at_corners += sign * normal_density(x[i]) * (normal_density(high) - normal_density(low)) / rest;
    const double on_y =
        sign * normal_density(y[i]) *
        (normal_integral((x[1] - rho * y[i]) / rest) - normal_integral((x[0] - rho * y[i]) / rest));
    line_y += on_y;
    slope_y += y[i] * on_y;
  }
  return {.share = corners.share({x[0], y[0]}, {x[1], y[1]}),
          .by_x = -line_x / sd_x,
          .by_y = -turn * line_y / sd_y,
          .by_xx = -0.5 * (slope_x + rho * at_corners) / density.xx,
          .by_xy = turn * at_corners / (sd_x * sd_y),
          .by_yy = -0.5 * (slope_y + rho * at_corners) / density.yy};
}

}  // namespace glasswing
