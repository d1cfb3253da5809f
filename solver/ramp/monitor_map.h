// Maps each camera pixel to the monitor position that it sees past the object, from the colours of the empty
// ramp:
//
//   n . C = 2,   u = (2 n_r C_r / n . C - .1) / .8,   v = (2 n_g C_g / n . C - .1) / .8
//
// since the ramp is the plane r + g + 2b = 2 and the camera's channels see 1/n_r, 1/n_g and 2/n_b of the
// primaries. n follows by least squares over the whole picture, then a homography from camera to monitor from
// all (u, v). Both use robust weights 1 / (1 + (residual / 3 sd)^2)^2, sd from the median, which exclude
// pixels beyond the monitor's edge.
#pragma once

#include <absl/status/statusor.h>

#include <array>

#include "core/image/image.h"

namespace glasswing {

class MonitorMap {
 public:
  // `empty`: light of the empty ramp, in the monitor's primaries. FAILED_PRECONDITION: it does not show the
  // ramp.
  static absl::StatusOr<MonitorMap> fit(const RadianceImage& empty, int monitor_width_px,
                                        int monitor_height_px);

  // Maps camera px to monitor px, both from the outer corner of the first pixel.
  std::array<double, 2> place(double x_px, double y_px) const {
    const double w = h_[6] * x_px + h_[7] * y_px + 1.0;
    return {(h_[0] * x_px + h_[1] * y_px + h_[2]) / w, (h_[3] * x_px + h_[4] * y_px + h_[5]) / w};
  }
  // Its derivative: monitor px per camera px, by rows x and y.
  std::array<double, 4> slope(double x_px, double y_px) const;

  const std::array<double, 3>& plane() const { return plane_; }  // n
  // The median distance of the positions given by colours from the map, monitor px.
  double residual_px() const { return residual_px_; }

 private:
  MonitorMap() = default;

  std::array<double, 3> plane_{};
  std::array<double, 8> h_{};
  double residual_px_ = 0.0;
};

}  // namespace glasswing
