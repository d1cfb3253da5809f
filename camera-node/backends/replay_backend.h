// The row of the replay of an archive in the table of backends.
#pragma once

#include "camera-node/camera_backend.h"

namespace glasswing {

CameraBackend replay_backend();

}  // namespace glasswing
