// Where on a monitor a pixel's light comes from, as a picture of the monitor's size.
#pragma once

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// The share of each monitor pixel in the light of matte pixel (x, y), counted from the tile's corner, by
// channel: Gaussians, boxes and pyramids alike.
RadianceImage footprint_picture(const Matte& matte, int x, int y, int texture);

}  // namespace glasswing
