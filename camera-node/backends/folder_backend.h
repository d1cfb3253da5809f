// The row of cameras whose pictures come into a folder in the table of backends.
#pragma once

#include "camera-node/camera_backend.h"

namespace glasswing {

CameraBackend folder_backend();

}  // namespace glasswing
