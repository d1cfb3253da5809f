// All kinds of display there are.
#pragma once

#include <vector>

#include "display-node/display_backend.h"

namespace glasswing {

// In the order of --help; the first is the default.
std::vector<DisplayBackend> display_backends();

}  // namespace glasswing
