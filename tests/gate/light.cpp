#include "tests/gate/light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace glasswing::gate {
namespace {

constexpr double kPi = std::numbers::pi;

// Shade of the stimulus at a point, before its colour.
double shade(const v1::Stimulus& stimulus, double x, double y) {
  const double phi = stimulus.phi_deg() * kPi / 180.0;
  const double along = x * std::cos(phi) + y * std::sin(phi);
  if (stimulus.kind() == "solid") return 1.0;
  if (stimulus.kind() == "gauss_stripe")
    return stimulus.peak() * std::exp(-0.5 * std::pow((along - stimulus.r_px()) / stimulus.sigma_px(), 2.0));
  if (stimulus.kind() == "sinusoid") {
    const double phase = stimulus.phase_deg() * kPi / 180.0;
    return stimulus.peak() * 0.5 * (1.0 + std::cos(2.0 * kPi * along / stimulus.period_px() - phase));
  }
  if (stimulus.kind() == "square") {
    const double t = stimulus.orient() == "vertical_bars" ? x : y;
    const auto bar = std::llround(std::floor((t - stimulus.offset_px()) / stimulus.bar_width_px()));
    return (bar % 2 == 0) != stimulus.inverse() ? 1.0 : 0.0;
  }
  throw std::invalid_argument("no definition of " + stimulus.kind());
}

// Nodes and weights of three-point Gauss-Legendre in `cells` equal parts of [0, 1].
std::vector<std::array<double, 2>> nodes(int cells) {
  const double off = 0.5 * std::sqrt(0.6);
  std::vector<std::array<double, 2>> all;
  for (int i = 0; i < cells; ++i) {
    for (const auto& [at, weight] : {std::array{0.5 - off, 5.0}, {0.5, 8.0}, {0.5 + off, 5.0}})
      all.push_back({(i + at) / cells, weight / (18.0 * cells)});
  }
  return all;
}

}  // namespace

RadianceImage drawn(const v1::Stimulus& stimulus, Size size) {
  RadianceImage shown(size.width_px, size.height_px);
  for (int y = 0; y < size.height_px; ++y) {
    for (int x = 0; x < size.width_px; ++x) {
      const double u = (x + 0.5) / size.width_px, v = (y + 0.5) / size.height_px;
      const bool ramp = stimulus.kind() == "ramp";
      const std::array<double, 3> on_ramp{0.1 + 0.8 * u, 0.1 + 0.8 * v, 0.9 - 0.4 * u - 0.4 * v};
      const double gray = ramp ? 0.0 : shade(stimulus, x + 0.5, y + 0.5);
      for (int c = 0; c < 3; ++c) {
        const double colour = stimulus.colour_size() == 3 ? stimulus.colour(c) : 1.0;
        shown.at(x, y, c) = static_cast<float>(ramp ? on_ramp[c] : colour * gray);
      }
    }
  }
  return shown;
}

Gaussian gaussian(const Slanted& slanted) {
  const double phi = slanted.degrees * kPi / 180.0, c = std::cos(phi), s = std::sin(phi);
  const double a = slanted.along_px * slanted.along_px, b = slanted.across_px * slanted.across_px;
  return {.x_px = slanted.x_px,
          .y_px = slanted.y_px,
          .xx_px2 = a * c * c + b * s * s,
          .xy_px2 = (a - b) * c * s,
          .yy_px2 = a * s * s + b * c * c};
}

Shares shares_of(const Gaussian& density, Size size) {
  const double xx = density.xx_px2, xy = density.xy_px2, yy = density.yy_px2;
  const double determinant = xx * yy - xy * xy;
  const double narrowest = std::sqrt(0.5 * (xx + yy) - std::hypot(0.5 * (xx - yy), xy));
  const double scale = 1.0 / (2.0 * kPi * std::sqrt(determinant));
  const auto points = nodes(std::max(1, static_cast<int>(std::ceil(2.0 / narrowest))));
  const auto first = [](double centre, double reach) {
    return std::max(0, static_cast<int>(std::floor(centre - reach)));
  };
  const auto last = [](double centre, double reach, int side) {
    return std::min(side - 1, static_cast<int>(std::floor(centre + reach)));
  };
  const double reach_x = 6.0 * std::sqrt(xx), reach_y = 6.0 * std::sqrt(yy);
  Shares shares;
  for (int y = first(density.y_px, reach_y); y <= last(density.y_px, reach_y, size.height_px); ++y) {
    for (int x = first(density.x_px, reach_x); x <= last(density.x_px, reach_x, size.width_px); ++x) {
      double sum = 0.0;
      for (const auto& [v, down] : points) {
        for (const auto& [u, across] : points) {
          const double dx = x + u - density.x_px, dy = y + v - density.y_px;
          const double square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / determinant;
          if (square < 36.0) sum += across * down * std::exp(-0.5 * square);
        }
      }
      if (sum > 0.0) shares.push_back({x, y, sum * scale});
    }
  }
  return shares;
}

Shares shares_of(const Box& box, Size size) {
  const auto overlap = [](int pixel, double centre, double side) {
    return std::min(pixel + 1.0, centre + 0.5 * side) - std::max<double>(pixel, centre - 0.5 * side);
  };
  Shares shares;
  for (int y = 0; y < size.height_px; ++y) {
    const double down = overlap(y, box.y_px, box.height_px);
    for (int x = 0; down > 0.0 && x < size.width_px; ++x) {
      const double across = overlap(x, box.x_px, box.width_px);
      if (across > 0.0) shares.push_back({x, y, across * down / (box.width_px * box.height_px)});
    }
  }
  return shares;
}

double seen(const Shares& shares, const RadianceImage& shown, int channel) {
  double sum = 0.0;
  for (const Share& share : shares)
    sum += share.part * static_cast<double>(shown.at(share.x, share.y, channel));
  return sum;
}

double total(const Shares& shares) {
  double sum = 0.0;
  for (const Share& share : shares) sum += share.part;
  return sum;
}

}  // namespace glasswing::gate
