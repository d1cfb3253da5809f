// Makes single pixels of a matte of those on either side, mode by mode.
#pragma once

#include <cstdint>

#include "core/matte/matte.h"

namespace glasswing {

// Each pixel with one of `flags` and two opposite neighbours that have no flag at all becomes what lies
// between them: modes of both that look at the same place become one with the mean weight, centre and
// covariance, so that footprints do not widen as fill() widens them (fill.h). Of the four pairs those count
// that agree nearly as well as the best. Other pixels stay as they are. Flags and errors are as after fill().
void interpolate_pixels(Matte& matte, std::uint8_t flags);

}  // namespace glasswing
