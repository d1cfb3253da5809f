// The row of the simulated camera in the table of backends.
#pragma once

#include "camera-node/camera_backend.h"

namespace glasswing {

CameraBackend sim_backend();

}  // namespace glasswing
