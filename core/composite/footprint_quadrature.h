// How compositors integrate footprints over flat pixels.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "core/matte/matte.h"

namespace glasswing {

inline constexpr double kPointSigma_px = 1e-4;  // narrower footprints are points (or lines)
inline constexpr double kReachSigmas = 6.0;     // 2e-9 of a Gaussian lies beyond

// The 4-point Gauss-Legendre rule on [-1, 1].
inline constexpr std::array<double, 4> kNodes{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                              0.8611363115940526};
inline constexpr std::array<double, 4> kNodeWeights{0.3478548451374538, 0.6521451548625461,
                                                    0.6521451548625461, 0.3478548451374538};

// A Gaussian footprint as compositor.h integrates it: along the wider axis v by quadrature, along the other
// one, u, in closed form.
struct FootprintLines {
  bool exchanged;  // u is y, and v is x
  double uu, vv, uv, u0, v0;

  explicit FootprintLines(const Mode& mode)
      : exchanged(mode.xx_px2 > mode.yy_px2),
        uu(std::max<double>(exchanged ? mode.yy_px2 : mode.xx_px2, 0.0)),
        vv(std::max<double>(exchanged ? mode.xx_px2 : mode.yy_px2, 0.0)),
        uv(mode.xy_px2),
        u0(exchanged ? mode.y_px : mode.x_px),
        v0(exchanged ? mode.x_px : mode.y_px) {}

  // Calls line(v, mean, sigma, share) for Gaussians along u in the rows of pixels v, 0 <= v < height, which
  // together are the footprint.
  template <typename Line>
  void for_each(int height, const Line& line) const {
    const double sigma_v = std::sqrt(vv);
    if (sigma_v < kPointSigma_px) {
      const int v = static_cast<int>(std::floor(v0));
      if (v0 >= 0.0 && v < height) line(v, u0, std::sqrt(uu), 1.0);
      return;
    }
    const double slope = uv / vv;
    const double sigma_u = std::sqrt(std::max(uu - slope * uv, 0.0)), reach = kReachSigmas * sigma_v;
    const int first = std::clamp(static_cast<int>(std::floor(v0 - reach)), 0, height);
    const int last = std::clamp(static_cast<int>(std::ceil(v0 + reach)), 0, height);
    // Panels no wider than half of sigma_v, and narrow enough that the mean slides along u by about sigma_u
    // at most.
    const double slide = std::abs(slope) / std::max(sigma_u, 0.02);
    const double finest = std::max({1.0, 2.0 / sigma_v, std::min(slide, 50.0)});
    for (int v = first; v < last; ++v) {
      const double low = std::max<double>(v, v0 - reach), high = std::min<double>(v + 1, v0 + reach);
      const int panels = std::max(1, static_cast<int>(std::ceil((high - low) * finest)));
      const double half = 0.5 * (high - low) / panels;
      for (int p = 0; p < panels; ++p) {
        const double middle = low + (2 * p + 1) * half;
        for (size_t n = 0; n < kNodes.size(); ++n) {
          const double z = (middle + half * kNodes[n] - v0) / sigma_v;
          const double density = std::exp(-0.5 * z * z) / (sigma_v * std::sqrt(2.0 * std::numbers::pi));
          line(v, u0 + slope * z * sigma_v, sigma_u, kNodeWeights[n] * half * density);
        }
      }
    }
  }
};

// Calls pixel(u, twice its share) for the pixels 0 <= u < width of a line.
template <typename Pixel>
void for_pixels_of_line(double mean, double sigma, int width, const Pixel& pixel) {
  if (sigma < kPointSigma_px) {
    const int u = static_cast<int>(std::floor(mean));
    if (mean >= 0.0 && u < width) pixel(u, 2.0);
    return;
  }
  const int first = std::clamp(static_cast<int>(std::floor(mean - kReachSigmas * sigma)), 0, width);
  const int last = std::clamp(static_cast<int>(std::ceil(mean + kReachSigmas * sigma)), 0, width);
  const double scale = 1.0 / (sigma * std::numbers::sqrt2);
  double before = std::erf((first - mean) * scale);
  for (int u = first; u < last; ++u) {
    const double after = std::erf((u + 1 - mean) * scale);
    pixel(u, after - before);
    before = after;
  }
}

}  // namespace glasswing
