// The camera's lens: a pinhole with Brown's distortion in OpenCV's terms. Of u = (X/Z, Y/Z) and r = |u|:
//
//   d_x = u_x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 u_x u_y + p2 (r^2 + 2 u_x^2)
//   d_y = u_y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 u_y^2) + 2 p2 u_x u_y
//   pixel = (fx d_x + cx, fy d_y + cy)
//
// D. C. Brown, "Close-Range Camera Calibration", 1971. Pixels are continuous: (i, j) covers
// [i, i + 1) x [j, j + 1).
#pragma once

#include <cstddef>

namespace glasswing {

// The order of the parameters, and of CameraGeometry.sd.
enum LensNumber : std::size_t { kFx, kFy, kCx, kCy, kK1, kK2, kP1, kP2, kK3, kLensNumbers };

// T: double, or a type that carries derivatives.
template <typename T>
void lens_pixel(const T* lens, const T& x, const T& y, T* pixel) {
  const T r2 = x * x + y * y, xy = x * y;
  const T radial = 1.0 + r2 * (lens[kK1] + r2 * (lens[kK2] + r2 * lens[kK3]));
  const T dx = x * radial + 2.0 * lens[kP1] * xy + lens[kP2] * (r2 + 2.0 * x * x);
  const T dy = y * radial + lens[kP1] * (r2 + 2.0 * y * y) + 2.0 * lens[kP2] * xy;
  pixel[0] = lens[kFx] * dx + lens[kCx];
  pixel[1] = lens[kFy] * dy + lens[kCy];
}

}  // namespace glasswing
