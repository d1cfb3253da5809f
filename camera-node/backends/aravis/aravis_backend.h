// The row of GenICam cameras in the table of backends.
#pragma once

#include "camera-node/camera_backend.h"

namespace glasswing {

CameraBackend aravis_backend();

}  // namespace glasswing
