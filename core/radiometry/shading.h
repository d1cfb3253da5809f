// The shading of a camera and of monitors over their pictures, from their calibrations: the camera's radial
// fall-off and each monitor's grid of uniformity.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class Shading {
 public:
  // Uncalibrated devices have no shading. INVALID_ARGUMENT: light of 0 or less somewhere, or an invalid grid.
  static absl::StatusOr<Shading> create(const v1::CaptureManifest& manifest);

  bool is_uniform() const { return !fades_ && grids_.empty(); }
  // Light of a uniform surface at the centre of pixel (x, y), relative to the centre of the camera's picture:
  // 1 + r2 r^2 + r4 r^4, r = 1 in the corners.
  double camera(int x, int y) const;
  // Light of a monitor at a point in monitor px, relative to its centre; `texture` is its index in the
  // manifest. Bilinear between the centres of the grid's cells, constant beyond the outermost.
  double monitor(int texture, double x_px, double y_px) const;

 private:
  struct Grid {
    int columns = 0, rows = 0;
    double cell_width_px = 1.0, cell_height_px = 1.0;
    std::vector<double> light;
  };

  int width_px_ = 1, height_px_ = 1;
  bool fades_ = false;
  double r2_ = 0.0, r4_ = 0.0;
  std::vector<Grid> grids_;  // by texture; no columns: uniform; empty: all uniform
};

}  // namespace glasswing
