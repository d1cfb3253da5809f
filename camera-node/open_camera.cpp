#include "camera-node/open_camera.h"

#include "camera-node/backends/libcamera_camera.h"
#include "camera-node/backends/replay_camera.h"
#include "camera-node/backends/sim_camera.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

absl::StatusOr<std::unique_ptr<Camera>> open_real(const CameraOptions& options) {
  if (options.backend == "libcamera") return LibcameraCamera::open(options.real);
  if (options.archive.empty()) return absl::InvalidArgumentError("--backend replay needs --archive DIR");
  return ReplayCamera::open(
      {.name = options.real.name, .archive = options.archive, .frame_rate_hz = options.real.frame_rate_hz});
}

}  // namespace

absl::StatusOr<OpenedCamera> open_camera(const CameraOptions& options, const EmissionTimeline& timeline) {
  OpenedCamera opened;
  if (options.backend == "sim") {
    GW_ASSIGN_OR_RETURN(std::unique_ptr<SimCamera> camera, SimCamera::create(options.sim, timeline));
    if (options.stage == "sim") opened.stage = camera.get();
    opened.camera = std::move(camera);
  } else {
    GW_ASSIGN_OR_RETURN(opened.camera, open_real(options));
  }
  if (opened.stage == nullptr) {
    opened.manual = std::make_unique<ManualStage>();
    opened.stage = opened.manual.get();
  }
  return opened;
}

}  // namespace glasswing
