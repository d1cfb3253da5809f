// Which place of the monitor each camera pixel sees past the object, told by the colours of the empty ramp:
//
//   n . C = 2,   u = (2 n_r C_r / n . C - .1) / .8,   v = (2 n_g C_g / n . C - .1) / .8
//
// as the ramp is the plane r + g + 2b = 2, of which the camera's channels see 1/n_r, 1/n_g and 2/n_b of each
// primary. n by least squares over the whole picture; then a homography from camera to monitor through all
// (u, v). Both are reweighted, 1 / (1 + (residual / 3 sd)^2)^2, sd from the median: what lies beyond the
// monitor's edge does not count.
#pragma once

#include <absl/status/statusor.h>

#include <array>

#include "core/frame/image.h"

namespace glasswing {

class MonitorMap {
 public:
  // `empty`: light of the empty ramp, in the monitor's primaries. FAILED_PRECONDITION: it does not show the
  // ramp.
  static absl::StatusOr<MonitorMap> fit(const RadianceImage& empty, int monitor_width_px,
                                        int monitor_height_px);

  // Camera px to monitor px, both from the outer corner of the first pixel.
  std::array<double, 2> place(double x_px, double y_px) const {
    const double w = h_[6] * x_px + h_[7] * y_px + 1.0;
    return {(h_[0] * x_px + h_[1] * y_px + h_[2]) / w, (h_[3] * x_px + h_[4] * y_px + h_[5]) / w};
  }
  // Its derivative: monitor px a camera px, by rows x and y.
  std::array<double, 4> slope(double x_px, double y_px) const;

  const std::array<double, 3>& plane() const { return plane_; }  // n
  // The median distance of the places that colours tell from the map, monitor px.
  double residual_px() const { return residual_px_; }

 private:
  MonitorMap() = default;

  std::array<double, 3> plane_{};
  std::array<double, 8> h_{};
  double residual_px_ = 0.0;
};

}  // namespace glasswing
