#include "core/footprint/normal_rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/footprint/gauss_legendre.h"

namespace glasswing {
namespace {

constexpr double kFarCorner = 5.5;  // standard deviations: e(t) < 3e-7
constexpr double kMaxRho = 0.99999;
constexpr double kAll = 8.3;       // Phi is 1 to the last bit from here
constexpr double kNothing = 37.5;  // phi is below the least normal number

constexpr double kFourSuffice = 0.5, kSixSuffice = 0.9, kTenSuffice = 0.98, kSteep = 0.998;  // rho

const GaussLegendre<4> kFour;
const GaussLegendre<6> kSix;
const GaussLegendre<10> kTen;
const GaussLegendre<16> kSixteen;

}  // namespace

double normal_integral(double z) {
  if (z > kAll) return 1.0;
  return 0.5 * std::erfc(-z / std::numbers::sqrt2);
}

double normal_density(double z) {
  if (std::abs(z) > kNothing) return 0.0;
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

double NormalCorners::joint(double h, double k) const {
  if (std::abs(h) > kFarCorner || std::abs(k) > kFarCorner) return 0.0;
  double sum = 0.0;
  for (size_t n = 0; n < node_count; ++n)
    sum += weight[n] * std::exp(-(h * h + k * k - 2.0 * h * k * sine[n]) * scale[n]);
  return sum;
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
      share += sign * joint(h, k);
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

NormalOnRectangles::Line NormalOnRectangles::line(double place, double mean, double sd) const {
  const double z = (place - mean) / sd;
  return {.z = z, .below = normal_integral(z), .density = normal_density(z)};
}

// The density on each line, where the other coordinate has mean rho z and standard deviation `rest`, and
// what is left of and above a corner: a rectangle's are the differences between its corners.
NormalShare NormalOnRectangles::at(const Line& x, const Line& y) const {
  const double rho = corners_.rho, rest = corners_.rest;
  const double above = (y.z - rho * x.z) / rest;
  const double on_x = x.density > 0.0 ? x.density * normal_integral(above) : 0.0,
               on_y = y.density > 0.0 ? y.density * normal_integral((x.z - rho * y.z) / rest) : 0.0;
  const double corner = x.density > 0.0 ? x.density * normal_density(above) / rest : 0.0;
  return {
      .share = (corners_.steep ? std::min(x.below, y.below) : x.below * y.below) + corners_.joint(x.z, y.z),
      .by_x = -on_x / sd_x_,
      .by_y = -turn_ * on_y / sd_y_,
      .by_xx = -0.5 * (x.z * on_x + rho * corner) / density_.xx,
      .by_xy = turn_ * corner / (sd_x_ * sd_y_),
      .by_yy = -0.5 * (y.z * on_y + rho * corner) / density_.yy};
}

NormalShare NormalOnRectangles::share(const Rectangle& rectangle) const {
  return cells(rectangle.left, rectangle.right - rectangle.left, 1, rectangle.top,
               rectangle.bottom - rectangle.top, 1)
      .front();
}

std::vector<NormalShare> NormalOnRectangles::cells(double left, double width, int columns, double top,
                                                   double height, int rows) const {
  std::vector<Line> xs;
  for (int i = 0; i <= columns; ++i) xs.push_back(line(left + i * width, density_.x, sd_x_));
  std::vector<NormalShare> cells, above, here;
  for (int j = 0; j <= rows; ++j) {
    const Line y = line(turn_ * (top + j * height), turn_ * density_.y, sd_y_);
    here.clear();
    for (const Line& x : xs) here.push_back(at(x, y));
    for (size_t i = 0; j > 0 && i + 1 < xs.size(); ++i) {
      const auto difference = [&](double NormalShare::*part) {
        return turn_ * (here[i + 1].*part - here[i].*part - above[i + 1].*part + above[i].*part);
      };
      cells.push_back({.share = difference(&NormalShare::share),
                       .by_x = difference(&NormalShare::by_x),
                       .by_y = difference(&NormalShare::by_y),
                       .by_xx = difference(&NormalShare::by_xx),
                       .by_xy = difference(&NormalShare::by_xy),
                       .by_yy = difference(&NormalShare::by_yy)});
    }
    std::swap(above, here);
  }
  return cells;
}

}  // namespace glasswing
