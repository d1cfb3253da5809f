#include "camera-node/backends/replay_backend.h"

#include <memory>

#include "camera-node/backends/replay_camera.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

absl::StatusOr<OpenedCamera> open_replay(const std::string& archive, const CameraSettings& settings) {
  if (archive.empty()) return absl::InvalidArgumentError("--backend replay needs --archive DIR");
  GW_ASSIGN_OR_RETURN(
      std::shared_ptr<Camera> opened,
      ReplayCamera::open(
          {.name = settings.name, .archive = archive, .frame_rate_hz = settings.frame_rate_hz}));
  return OpenedCamera{.camera = std::move(opened)};
}

}  // namespace

CameraBackend replay_backend() {
  const auto archive = std::make_shared<std::string>();
  return {.name = "replay",
          .shared = {"--fps"},
          .add_options =
              [archive](CLI::App& app) {
                app.add_option("--archive", *archive, "replay: directory of the session archive to replay");
              },
          .open = [archive](const CameraSettings& settings) { return open_replay(*archive, settings); }};
}

}  // namespace glasswing
