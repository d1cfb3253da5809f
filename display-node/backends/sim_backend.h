// The row of simulated screens in the table of backends.
#pragma once

#include "display-node/display_backend.h"

namespace glasswing {

DisplayBackend sim_display_backend();

}  // namespace glasswing
