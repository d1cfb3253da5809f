// Counts of a matte's pixels in a part of the picture.
#pragma once

#include "core/matte/matte.h"
#include "core/matte/matte_region.h"

namespace glasswing {

// count_pixels() of the region alone, in the camera's pixels.
PixelCount count_pixels(const Matte& matte, const MatteRegion& region);

}  // namespace glasswing
