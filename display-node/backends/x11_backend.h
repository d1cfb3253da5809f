// The row of screens of an X server in the table of backends.
#pragma once

#include "display-node/display_backend.h"

namespace glasswing {

DisplayBackend x11_display_backend();

}  // namespace glasswing
