#include "camera-node/backends/libcamera_backend.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "camera-node/backends/libcamera_camera.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

struct LibcameraOptions {
  LibcameraCamera::Options libcamera;
  std::string stamp = "unknown";
  std::optional<double> delay_ms;
};

std::optional<nanoseconds> nanoseconds_of(const std::optional<double>& ms) {
  return ms ? std::optional(nanoseconds(std::llround(*ms * 1e6))) : std::nullopt;
}

StampMeaning meaning_of(const std::string& stamp) {
  if (stamp == "start") return StampMeaning::kStart;
  if (stamp == "readout") return StampMeaning::kReadout;
  if (stamp == "arrival") return StampMeaning::kArrival;
  return StampMeaning::kUnknown;
}

void add_libcamera_options(CLI::App& app, LibcameraOptions& options) {
  app.add_option("--camera", options.libcamera.camera, "libcamera: the camera's id or model, or part of it");
  app.add_option("--fixed-exposure-ms", options.libcamera.fixed_exposure_ms,
                 "libcamera: exposure of a camera that has no control for it")
      ->check(CLI::Range(0.01, 10000.0));
  app.add_option(
         "--stamp", options.stamp,
         "libcamera: meaning of the driver's time stamps: start of the first row's exposure or of its "
         "readout, or arrival of its data here")
      ->check(CLI::IsMember({"unknown", "start", "readout", "arrival"}))
      ->capture_default_str();
  app.add_option("--stamp-delay-ms", options.delay_ms,
                 "libcamera: maximum time from a frame's readout to its data's arrival; default: one frame")
      ->check(CLI::Range(0.0, 1000.0));
}

absl::StatusOr<OpenedCamera> open_libcamera(const LibcameraOptions& options, const CameraSettings& settings) {
  LibcameraCamera::Options camera = options.libcamera;
  camera.name = settings.name;
  camera.format = settings.format;
  camera.size = settings.size;
  camera.frame_rate_hz = settings.frame_rate_hz;
  camera.gain = settings.gain.value_or(camera.gain);
  if (!(camera.gain >= 0.1 && camera.gain <= 1000.0)) {
    return absl::InvalidArgumentError(
        fmt::format("--gain is {}; with --backend libcamera it must be 0.1 to 1000", camera.gain));
  }
  camera.stamp = meaning_of(options.stamp);
  camera.delay = nanoseconds_of(options.delay_ms);
  camera.readout = nanoseconds_of(settings.readout_ms);
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Camera> opened, LibcameraCamera::open(camera));
  return OpenedCamera{.camera = std::move(opened)};
}

}  // namespace

CameraBackend libcamera_backend() {
  const auto own = std::make_shared<LibcameraOptions>();
  return {.name = "libcamera",
          .shared = {"--size", "--fps", "--format", "--gain", "--readout-ms"},
          .add_options = [own](CLI::App& app) { add_libcamera_options(app, *own); },
          .open = [own](const CameraSettings& settings) { return open_libcamera(*own, settings); }};
}

}  // namespace glasswing
