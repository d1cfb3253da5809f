#include "camera-node/camera_options.h"

#include <algorithm>

#include "camera-node/backend_table.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

absl::StatusOr<PictureSize> parse_size(const std::string& text) {
  PictureSize size{};
  if (!Scanner(text).number(size.width_px).then("x").number(size.height_px).done() || size.width_px < 1 ||
      size.height_px < 1 || size.width_px > 16384 || size.height_px > 16384)
    return absl::InvalidArgumentError("--size is " + text + "; it must be WIDTHxHEIGHT, each 1 to 16384");
  return size;
}

void add_camera_choice(CLI::App& app, CameraOptions& camera) {
  app.add_option("--server", camera.server, "host:port of glasswing-server, to register with");
  app.add_option("--name", camera.settings.name, "this node's name in the rig")->capture_default_str();
  app.add_option("--data", camera.data, "directory for the archives")->required();
  app.add_option("--reserve", camera.reserve_mb,
                 "MB of disk space to leave free: a capture that would need them waits for space. Default: 2 "
                 "% of the "
                 "disk, but at least 1000, or a tenth of a small disk")
      ->check(CLI::Range(0.0, 1e9));
  std::vector<std::string> names;
  for (const CameraBackend& backend : camera.backends) names.emplace_back(backend.name);
  app.add_option("--backend", camera.backend, "which kind of camera")
      ->check(CLI::IsMember(names))
      ->capture_default_str();
}

// Those of CameraSettings.
void add_shared_options(CLI::App& app, CameraOptions& camera) {
  CameraSettings& settings = camera.settings;
  app.add_option("--size", camera.size,
                 "WIDTHxHEIGHT of its pictures; default: 128x96, or a real camera's own");
  app.add_option("--fps", settings.frame_rate_hz,
                 "frames per second; default: 200 for sim, otherwise the camera's own")
      ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--format", settings.format,
                 "pixel format; libcamera: such as SRGGB10 or YUYV, default: the best available; aravis: "
                 "such as Mono12p "
                 "or BayerRG8, default: as set on the camera");
  app.add_option("--gain", settings.gain,
                 "libcamera: gain that frames must report: analogue, times digital in processed formats; "
                 "default: 1; aravis: in the camera's unit, often dB; default: as set on the camera");
  app.add_option("--black-level", settings.black_level,
                 "sim: sample without light, as a fraction of full scale, before the response; default: 0; "
                 "aravis: in the camera's unit; default: as set on the camera");
  app.add_option("--readout-ms", settings.readout_ms,
                 "time from the first row's start to the last row's, 0 with a global shutter; default for "
                 "libcamera: as the camera reports it, or one frame; for aravis: 0")
      ->check(CLI::Range(0.0, 1000.0));
}

}  // namespace

absl::StatusOr<OpenedCamera> CameraOptions::open(const CLI::App& app) const {
  GW_RETURN_IF_ERROR(backend_options.check(app, backend));
  CameraSettings given = settings;
  if (!size.empty()) {
    GW_ASSIGN_OR_RETURN(given.size, parse_size(size));
  }
  return std::ranges::find(backends, backend, &CameraBackend::name)->open(given);
}

// In the order of --help.
void add_camera_options(CLI::App& app, DaemonOptions& daemon, CameraOptions& camera) {
  daemon.listen.address = "127.0.0.1:7442";
  camera.backends = camera_backends();
  add_listen_options(app, daemon.listen);
  add_camera_choice(app, camera);
  add_shared_options(app, camera);
  for (const CameraBackend& backend : camera.backends) {
    camera.backend_options.add(app, backend.name, backend.add_options);
    for (const std::string_view option : backend.shared) camera.backend_options.share(backend.name, option);
  }
  app.add_option("--stage", camera.stage, "who moves the object; manual without --backend sim")
      ->check(CLI::IsMember({"sim", "manual"}))
      ->capture_default_str();
  add_stage_options(app, camera.axes);
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing
