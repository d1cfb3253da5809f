// All kinds of cameras, in the order of --help.
#pragma once

#include <vector>

#include "camera-node/camera_backend.h"

namespace glasswing {

std::vector<CameraBackend> camera_backends();

}  // namespace glasswing
