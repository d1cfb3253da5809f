// The row of cameras driven by libcamera in the table of backends.
#pragma once

#include "camera-node/camera_backend.h"

namespace glasswing {

CameraBackend libcamera_backend();

}  // namespace glasswing
