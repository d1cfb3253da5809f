// How a camera and monitors fade over their pictures, as their calibrations say.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class Shading {
 public:
  // What is not calibrated counts as even. INVALID_ARGUMENT: light that would be 0 or less somewhere, or a
  // grid that is none.
  static absl::StatusOr<Shading> create(const v1::CaptureManifest& manifest);

  bool is_uniform() const { return !fades_ && grids_.empty(); }
  // What the camera sees of an even surface at the centre of pixel (x, y), of that in the picture's middle:
  // 1 + r2 r^2 + r4 r^4, r = 1 in the corners.
  double camera(int x, int y) const;
  // The light of a monitor (its place in the manifest) at a place in monitor px, of that in its middle.
  // Straight between the middles of the grid's cells, even beyond the outermost.
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
  std::vector<Grid> grids_;  // by texture, without columns where even; none if all are
};

}  // namespace glasswing
