#include "camera-node/backends/folder_backend.h"

#include <cmath>
#include <memory>

#include "camera-node/backends/folder_camera.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

struct FolderOptions {
  std::string directory, shoot, curve;
  std::optional<double> exposure_ms;
  double patience_s = 40.0;
};

void add_folder_options(CLI::App& app, FolderOptions& options) {
  app.add_option(
      "--folder", options.directory,
      "folder: the directory into which a tethering program drops the pictures (JPEG, PNG, TIFF, or raw)");
  app.add_option(
      "--shoot", options.shoot,
      "folder: a program and its arguments that takes one picture into the folder ({dir}), or gphoto2; "
      "default: a person presses the button");
  app.add_option("--patience", options.patience_s,
                 "folder: seconds from a picture's command to its file, before it is requested again")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_option("--exposure-ms", options.exposure_ms, "folder: exposure of pictures that do not record it")
      ->check(CLI::Range(0.01, 3.6e6));
  app.add_option("--curve", options.curve,
                 "folder: response of pictures that are not raw: srgb, linear, gamma:G, or unknown; default: "
                 "srgb with 8 "
                 "bits, linear with 16");
}

absl::StatusOr<OpenedCamera> open_folder(const FolderOptions& options, const CameraSettings& settings) {
  if (options.directory.empty()) return absl::InvalidArgumentError("--backend folder needs --folder DIR");
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Camera> opened,
                      FolderCamera::open({.name = settings.name,
                                          .directory = options.directory,
                                          .shoot = options.shoot,
                                          .patience = nanoseconds(std::llround(1e9 * options.patience_s)),
                                          .exposure_ms = options.exposure_ms,
                                          .curve = options.curve}));
  return OpenedCamera{.camera = std::move(opened), .detail = "pictures from " + options.directory};
}

}  // namespace

CameraBackend folder_backend() {
  const auto own = std::make_shared<FolderOptions>();
  return {.name = "folder",
          .shared = {},
          .add_options = [own](CLI::App& app) { add_folder_options(app, *own); },
          .open = [own](const CameraSettings& settings) { return open_folder(*own, settings); }};
}

}  // namespace glasswing
