// One frame of a video matte, plane by plane:
//
//   C = f W + (1 - alpha) B + rho M(T, A(c, w)),   W = (1, 1, 1)      (Chuang et al. 2000, eq. 30)
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

struct RampFrame {
  RampFrame() = default;
  // All 0.
  RampFrame(int width, int height) { resize(width, height); }
  // Leaves the contents unspecified.
  void resize(int width, int height) {
    width_px = width;
    height_px = height;
    const size_t count = static_cast<size_t>(width) * height;
    for (std::vector<float>* plane : {&alpha, &rho, &x_px, &y_px, &highlight, &info_xx, &info_xy, &info_yy})
      plane->resize(count);
    flags.resize(count);
  }

  int width_px = 0, height_px = 0;
  // By rows, width x height each.
  std::vector<float> alpha;       // 1 on the object, 0 off it, feathered between
  std::vector<float> rho;         // share of the light at c that arrives
  std::vector<float> x_px, y_px;  // c, monitor px; off the object: the position straight behind
  std::vector<float> highlight;   // f, radiance
  // Inverse covariance of c, 1/px^2, from the noise and the manifold's Jacobian. 0: c is unknown, as in a
  // highlight.
  std::vector<float> info_xx, info_xy, info_yy;
  float rho_sd = 0.0f;              // standard deviation of rho, from the noise
  std::vector<std::uint8_t> flags;  // PixelFlag bits
};

}  // namespace glasswing
