#include "camera-node/backend_table.h"

#include "camera-node/backends/aravis/aravis_backend.h"
#include "camera-node/backends/folder_backend.h"
#include "camera-node/backends/libcamera_backend.h"
#include "camera-node/backends/replay_backend.h"
#include "camera-node/backends/sim_backend.h"

namespace glasswing {

std::vector<CameraBackend> camera_backends() {
  return {
      sim_backend(), libcamera_backend(), aravis_backend(), folder_backend(), replay_backend(),
  };
}

}  // namespace glasswing
