// Draws a result: photograph, composite, difference x 8, number of modes and width, side by side. Without the
// first two if `photographs` is false: the scenes' photographs have no licence.
#pragma once

#include <string>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

void write_sheet(const std::string& path, const RadianceImage& photograph, const RadianceImage& composite,
                 const Matte& matte, bool photographs);

}  // namespace glasswing
