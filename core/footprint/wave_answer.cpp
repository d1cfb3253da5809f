#include "core/footprint/wave_answer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/footprint/cut_footprint.h"
#include "core/footprint/faddeeva.h"
#include "core/footprint/finite_product.h"
#include "core/footprint/gauss_legendre.h"

namespace glasswing {
namespace {

using Complex = std::complex<double>;

constexpr double kLeastVariance_px2 = 0.01;  // narrower footprints are treated as points at an edge
constexpr double kMaxCorrelation = 0.999;
constexpr double kWaveReach = 5.0;  // standard deviations
constexpr double kNoLight = 5.5;    // the same: less than 3e-7 of a footprint's density
constexpr double kMaxTurn = 6.0;    // wx wy xy: logarithm of how far terms of Plackett's identity may change
// Most of a panel of the quadrature: standard deviations, radians.
constexpr double kPanelReach = 2.0, kPanelTurn = 16.0;

// Plackett's integral up to a correlation of 0.9 and beyond, and a panel: right to 1e-7.
constexpr double kMuchCorrelation = 0.9;
const GaussLegendre<8> kFew;
const GaussLegendre<12> kMore;
const GaussLegendre<16> kPanel;

// exp(i omega t) at the monitor's edges across t.
std::array<Complex, 2> edges_of(double omega, double size_px) {
  return {1.0, std::polar(1.0, omega * size_px)};
}

// A normal density of one coordinate, and the monitor's edges across it.
struct NormalLine {
  double mean, sd, size_px;

  double density(double t) const {
    const double z = (t - mean) / sd;
    return std::exp(-0.5 * z * z) / (sd * std::sqrt(2.0 * std::numbers::pi));
  }
  bool cut() const { return mean < kWaveReach * sd || size_px - mean < kWaveReach * sd; }
  // int density exp(i omega t) dt over the monitor; of_edges: exp(i omega t) at its edges.
  Complex waved(double omega, const std::array<Complex, 2>& of_edges) const {
    const double v = omega * sd * std::numbers::sqrt2 / 2.0;
    // From an edge to the nearer end.
    const auto tail = [&](double edge, const Complex& of_edge) {
      const double u = (edge - mean) / (sd * std::numbers::sqrt2);
      if (std::abs(u) > 4.0) return Complex(0.0);
      return 0.5 * std::exp(-u * u) * times(of_edge, faddeeva(Complex(u < 0.0 ? -v : v, std::abs(u))));
    };
    const Complex low = tail(0.0, of_edges[0]), high = tail(size_px, of_edges[1]);
    if (mean < 0.0) return low - high;  // both edges are above the mean
    if (mean > size_px) return high - low;
    return std::polar(std::exp(-v * v), omega * mean) - low - high;
  }
  Complex waved(double omega) const { return waved(omega, edges_of(omega, size_px)); }
};

// For one footprint of weight 1 and a wave.
class WavedRectangle {
 public:
  WavedRectangle(const Footprint& mode, double wx, double wy, const MonitorExtent& extent)
      : wx_(wx),
        wy_(wy),
        x_{.mean = mode.x_px,
           .sd = std::sqrt(std::max(mode.xx_px2, kLeastVariance_px2)),
           .size_px = extent.width_px},
        y_{.mean = mode.y_px,
           .sd = std::sqrt(std::max(mode.yy_px2, kLeastVariance_px2)),
           .size_px = extent.height_px},
        of_x_(edges_of(wx, extent.width_px)),
        of_y_(edges_of(wy, extent.height_px)),
        xy_(std::clamp(mode.xy_px2, -kMaxCorrelation * x_.sd * y_.sd, kMaxCorrelation * x_.sd * y_.sd)) {}

  WaveAnswer answer() const {
    const Complex ix(0.0, wx_), iy(0.0, wy_);
    const Edges edges = edges_at(xy_);
    const Complex inside = integral();
    const Complex along_x = edges.x[1] - edges.x[0], along_y = edges.y[1] - edges.y[0];
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    // int dG/dx exp(i w.p) along the edges across x, and likewise across y.
    Complex by_x = 0.0, by_y = 0.0;
    for (size_t i = 0; i < 2; ++i) {
      const double sign = i == 0 ? -1.0 : 1.0;
      const double dx = (i == 0 ? 0.0 : x_.size_px) - x_.mean, dy = (i == 0 ? 0.0 : y_.size_px) - y_.mean;
      by_x += sign * (-dx / xx * edges.x[i] +
                      xy_ / xx * (iy * edges.x[i] - (edges.corner[i][1] - edges.corner[i][0])));
      by_y += sign * (-dy / yy * edges.y[i] +
                      xy_ / yy * (ix * edges.y[i] - (edges.corner[1][i] - edges.corner[0][i])));
    }
    return {
        .value = inside,
        .slope = {-(ix * along_x + iy * along_y) / 12.0,  // what the edges' pixels add
                  ix * inside - along_x, iy * inside - along_y, 0.5 * (by_x - ix * (along_x - ix * inside)),
                  edges.corners() - iy * along_x - ix * along_y + ix * iy * inside,
                  0.5 * (by_y - iy * (along_y - iy * inside))}};
  }

 private:
  // Integrals along the edges [low, high] across x and across y, and the terms at their corners [x][y].
  struct Edges {
    std::array<Complex, 2> x{}, y{};
    std::array<std::array<Complex, 2>, 2> corner{};
    Complex corners() const { return corner[1][1] - corner[1][0] - corner[0][1] + corner[0][0]; }
  };

  Edges edges_at(double xy) const {
    Edges edges;
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    for (size_t i = 0; i < 2; ++i) {
      const double at_x = i == 0 ? 0.0 : x_.size_px, at_y = i == 0 ? 0.0 : y_.size_px;
      // No light lies along an edge far away.
      const bool near_x = std::abs(at_x - x_.mean) < kNoLight * x_.sd,
                 near_y = std::abs(at_y - y_.mean) < kNoLight * y_.sd;
      const NormalLine along_y{.mean = y_.mean + xy / xx * (at_x - x_.mean),
                               .sd = std::sqrt(yy - xy * xy / xx),
                               .size_px = y_.size_px};
      const NormalLine along_x{.mean = x_.mean + xy / yy * (at_y - y_.mean),
                               .sd = std::sqrt(xx - xy * xy / yy),
                               .size_px = x_.size_px};
      if (near_y) edges.y[i] = y_.density(at_y) * times(of_y_[i], along_x.waved(wx_, of_x_));
      if (!near_x) continue;
      const Complex here = x_.density(at_x) * of_x_[i];
      edges.x[i] = times(here, along_y.waved(wy_, of_y_));
      for (size_t j = 0; j < 2; ++j)
        edges.corner[i][j] = along_y.density(j == 0 ? 0.0 : y_.size_px) * times(here, of_y_[j]);
    }
    return edges;
  }

  // I.
  Complex integral() const {
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    if (!y_.cut()) {
      const double turn = xy_ / xx, rest = yy - xy_ * turn;
      return x_.waved(wx_ + wy_ * turn) *
             std::exp(Complex(-0.5 * wy_ * wy_ * rest, wy_ * (y_.mean - turn * x_.mean)));
    }
    if (!x_.cut()) {
      const double turn = xy_ / yy, rest = xx - xy_ * turn;
      return y_.waved(wy_ + wx_ * turn) *
             std::exp(Complex(-0.5 * wx_ * wx_ * rest, wx_ * (x_.mean - turn * y_.mean)));
    }
    if (std::abs(wx_ * wy_ * xy_) > kMaxTurn) return integral_over_lines();
    const double correlation = xy_ / (x_.sd * y_.sd), without = std::exp(-wx_ * wy_ * xy_);
    const Complex turned = std::abs(correlation) > kMuchCorrelation ? turned_to(correlation, kMore)
                                                                    : turned_to(correlation, kFew);
    return without * times(x_.waved(wx_, of_x_), y_.waved(wy_, of_y_)) + turned;
  }

  // The contribution of a correlation, by Plackett's identity.
  template <size_t N>
  Complex turned_to(double correlation, const GaussLegendre<N>& nodes) const {
    const double most = x_.sd * y_.sd, angle = std::asin(correlation);
    Complex sum = 0.0;
    for (size_t n = 0; n < N && angle != 0.0; ++n) {
      const double theta = 0.5 * angle * (1.0 + nodes.place[n]), xy = most * std::sin(theta);
      const Edges edges = edges_at(xy);
      const Complex slope = edges.corners() - Complex(0.0, wy_) * (edges.x[1] - edges.x[0]) -
                            Complex(0.0, wx_) * (edges.y[1] - edges.y[0]);
      sum +=
          0.5 * angle * nodes.weight[n] * most * std::cos(theta) * std::exp(-wx_ * wy_ * (xy_ - xy)) * slope;
    }
    return sum;
  }

  // I where the wave runs across a slanted footprint: the integral over y at each x, by quadrature over x.
  Complex integral_over_lines() const {
    const double turn = xy_ / (x_.sd * x_.sd), rest_sd = std::sqrt(y_.sd * y_.sd - xy_ * turn);
    const double low = std::max(0.0, x_.mean - kNoLight * x_.sd),
                 high = std::min(x_.size_px, x_.mean + kNoLight * x_.sd);
    if (low >= high) return 0.0;
    // Where y's mean passes an edge, the integral over y changes within rest_sd.
    std::vector<double> ends{low, high};
    for (const double edge_px : {0.0, y_.size_px}) {
      for (const double off : {-5.0, -2.0, 0.0, 2.0, 5.0}) {
        const double at = x_.mean + (edge_px - y_.mean + off * rest_sd) / turn;
        if (at > low && at < high) ends.push_back(at);
      }
    }
    std::ranges::sort(ends);
    const double most_px =
        std::min(kPanelReach * x_.sd, kPanelTurn / std::max(std::abs(wx_), std::abs(wx_ + wy_ * turn)));
    Complex sum = 0.0;
    for (size_t i = 0; i + 1 < ends.size(); ++i) {
      const double length_px = ends[i + 1] - ends[i];
      const int panels = std::max(1, static_cast<int>(std::ceil(length_px / most_px)));
      const double half_px = 0.5 * length_px / panels;
      for (int panel = 0; panel < panels; ++panel) {
        const double middle_px = ends[i] + (2 * panel + 1) * half_px;
        for (size_t n = 0; n < kPanel.place.size(); ++n) {
          const double x_px = middle_px + half_px * kPanel.place[n];
          const NormalLine y{.mean = y_.mean + turn * (x_px - x_.mean), .sd = rest_sd, .size_px = y_.size_px};
          sum += half_px * kPanel.weight[n] * x_.density(x_px) *
                 times(std::polar(1.0, wx_ * x_px), y.waved(wy_, of_y_));
        }
      }
    }
    return sum;
  }

  const double wx_, wy_;
  const NormalLine x_, y_;
  const std::array<Complex, 2> of_x_, of_y_;  // the wave at edges across x and y
  const double xy_;
};

// A narrow footprint cut by an edge: the sum over its pixels.
WaveAnswer sum_of_pixels(const Footprint& mode, double wx, double wy, const MonitorExtent& extent) {
  WaveAnswer answer{};
  for (const ReachedPixel& pixel : reached_pixels(mode, extent)) {
    const Complex light = std::exp(Complex(0.0, wx * pixel.x_px + wy * pixel.y_px));
    const NormalShare& part = pixel.part;
    answer.slope[0] += part.share * light;
    answer.slope[1] += mode.weight * part.by_x * light;
    answer.slope[2] += mode.weight * part.by_y * light;
    answer.slope[3] += mode.weight * part.by_xx * light;
    answer.slope[4] += mode.weight * part.by_xy * light;
    answer.slope[5] += mode.weight * part.by_yy * light;
  }
  answer.value = mode.weight * answer.slope[0];
  return answer;
}

}  // namespace

double sinc(double t) {
  return t == 0.0 ? 1.0 : std::sin(std::numbers::pi * t) / (std::numbers::pi * t);
}

WaveAnswer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent) {
  const double wx = 2.0 * std::numbers::pi * fx, wy = 2.0 * std::numbers::pi * fy, flat = sinc(fx) * sinc(fy);
  if (!near_edge(mode, extent)) {
    const double turned = wx * wx * mode.xx_px2 + 2.0 * wx * wy * mode.xy_px2 + wy * wy * mode.yy_px2;
    const Complex unit = flat * std::exp(Complex(-0.5 * turned, wx * mode.x_px + wy * mode.y_px)),
                  whole = mode.weight * unit, ix(0.0, wx), iy(0.0, wy);
    return {.value = whole,
            .slope = {unit, whole * ix, whole * iy, 0.5 * whole * ix * ix, whole * ix * iy,
                      0.5 * whole * iy * iy}};
  }
  if (narrow(mode)) return sum_of_pixels(mode, wx, wy, extent);
  WaveAnswer answer = WavedRectangle(mode, wx, wy, extent).answer();
  const Complex unit = flat * answer.value + answer.slope[0];
  answer.value = mode.weight * unit;
  answer.slope[0] = unit;
  for (size_t p = 1; p < 6; ++p) answer.slope[p] *= mode.weight * flat;
  return answer;
}

}  // namespace glasswing
