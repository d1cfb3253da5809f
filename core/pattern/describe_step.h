// Describes a step in words.
#pragma once

#include <string>

#include "core/pattern/plan.h"

namespace glasswing {

// "back stripe at 45 deg, r 120.0 px, 4 ms"
std::string describe(const Step& step);

}  // namespace glasswing
