// The row of connectors of a graphics card in the table of backends.
#pragma once

#include "display-node/display_backend.h"

namespace glasswing {

DisplayBackend kms_display_backend();

}  // namespace glasswing
