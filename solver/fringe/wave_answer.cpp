#include "solver/fringe/wave_answer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;
constexpr double kMinVariance_px2 = 1e-6;  // narrower footprints are points to an edge
constexpr int kMaxTerms = 38;              // of the series of complex_erf
constexpr double kMaxTurn = 12.0;  // argument of complex_erf; beyond it the wave has decayed to e^-144

// \int_0^extent of the Gaussian of this variance and complex mean, and its derivatives.
struct Part {
  Complex value{1.0, 0.0}, by_mean, by_variance;
};

Part part_within(Complex mean, double variance, double extent) {
  const double v = std::max(variance, kMinVariance_px2), scale = 1.0 / std::sqrt(2.0 * v);
  if (std::abs(mean.imag()) * scale > kMaxTurn) return {};
  const auto density = [&](double t) {
    return std::exp(-(t - mean) * (t - mean) / (2.0 * v)) / std::sqrt(2.0 * kPi * v);
  };
  const Complex low = density(0.0), high = density(extent);
  return {.value = 0.5 * (complex_erf((extent - mean) * scale) - complex_erf(-mean * scale)),
          .by_mean = low - high,
          .by_variance = -0.5 * (low * mean + high * (extent - mean)) / v};
}

// e^(-n^2 / 4).
const std::array<double, kMaxTerms + 1> kFlat = [] {
  std::array<double, kMaxTerms + 1> flat{};
  for (int n = 0; n <= kMaxTerms; ++n) flat[static_cast<size_t>(n)] = std::exp(-0.25 * n * n);
  return flat;
}();

}  // namespace

double sinc(double t) {
  return t == 0.0 ? 1.0 : std::sin(kPi * t) / (kPi * t);
}

Complex complex_erf(Complex z) {
  const double x = z.real(), y = z.imag();
  const double fall = std::exp(-x * x);
  Complex sum = std::erf(x);
  if (y == 0.0) return sum;
  const double cos2xy = std::cos(2.0 * x * y), sin2xy = std::sin(2.0 * x * y);
  sum += std::abs(x) < 1e-9 ? Complex(0.0, y / kPi) : fall / (2.0 * kPi * x) * Complex(1.0 - cos2xy, sin2xy);
  const int terms = std::min(static_cast<int>(2.0 * std::abs(y)) + 14, kMaxTerms);
  const double grow = std::exp(y), shrink = 1.0 / grow;
  double up = 1.0, down = 1.0;  // e^(ny), e^(-ny)
  Complex series = 0.0;
  for (int n = 1; n <= terms; ++n) {
    const double flat = kFlat[static_cast<size_t>(n)];
    up *= grow;
    down *= shrink;
    const double cosh_ny = 0.5 * flat * (up + down), sinh_ny = 0.5 * flat * (up - down);
    series += Complex(2.0 * x * (flat - cosh_ny * cos2xy) + n * sinh_ny * sin2xy,
                      2.0 * x * cosh_ny * sin2xy + n * sinh_ny * cos2xy) /
              (n * n + 4.0 * x * x);
  }
  return sum + 2.0 / kPi * fall * series;
}

WaveAnswer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent) {
  const double turned = fx * fx * mode.xx_px2 + 2.0 * fx * fy * mode.xy_px2 + fy * fy * mode.yy_px2;
  const Complex unit =
      sinc(fx) * sinc(fy) *
      std::exp(Complex(-2.0 * kPi * kPi * turned, 2.0 * kPi * (fx * mode.x_px + fy * mode.y_px)));
  const Complex ix(0.0, 2.0 * kPi * fx), iy(0.0, 2.0 * kPi * fy);
  Part x, y;
  if (near_edge(mode, extent)) {
    x = part_within(mode.x_px + ix * mode.xx_px2 + iy * mode.xy_px2, mode.xx_px2, extent.width_px);
    y = part_within(mode.y_px + ix * mode.xy_px2 + iy * mode.yy_px2, mode.yy_px2, extent.height_px);
  }
  const Complex both = unit * x.value * y.value;
  const Complex edge_x = mode.weight * unit * x.by_mean * y.value,
                edge_y = mode.weight * unit * x.value * y.by_mean;
  const Complex whole = mode.weight * both;
  return {.value = whole,
          .slope = {both, whole * ix + edge_x, whole * iy + edge_y,
                    0.5 * whole * ix * ix + edge_x * ix + mode.weight * unit * x.by_variance * y.value,
                    whole * ix * iy + edge_x * iy + edge_y * ix,
                    0.5 * whole * iy * iy + edge_y * iy + mode.weight * unit * x.value * y.by_variance}};
}

}  // namespace glasswing
