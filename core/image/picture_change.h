// How much a camera's frame differs from an earlier frame of the same picture on the same stage:
//
//   frame(p) = offset + gain reference(p - shift)
//
// by robust least squares over brightness, smoothed by a Gaussian: differences in only part of the picture,
// such as a new object, count as outliers.
#pragma once

#include <vector>

#include "core/image/image.h"

namespace glasswing {

// A frame's brightness on blocks of equal pixels, at most 320 along a side, smoothed.
struct Brightness {
  int block_px = 1;  // side of a block; even of a mosaic, so that each has all colours
  int width = 0, height = 0;
  std::vector<float> samples;  // height x width, of full scale
};
Brightness brightness_of(const Image16& frame);

struct PictureChange {
  // Whether most of the picture follows the equation above. Otherwise nothing below is valid.
  bool known = false;
  double gain = 1.0, gain_sd = 0.0;
  double offset = 0.0, offset_sd = 0.0;                             // of the reference's own range of light
  double dx_px = 0.0, dy_px = 0.0, dx_sd_px = 0.0, dy_sd_px = 0.0;  // to the right, and down
};

// Both from the same camera.
PictureChange change_between(const Brightness& reference, const Brightness& frame);

}  // namespace glasswing
