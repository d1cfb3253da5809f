#include "camera-node/camera_daemon.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "camera-node/camera_metrics.h"
#include "camera-node/services/axis_service.h"
#include "camera-node/services/calibration_service.h"
#include "camera-node/services/camera_service.h"
#include "camera-node/services/stage_service.h"
#include "core/archive/archive_metrics.h"
#include "core/archive/archive_service.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/daemon/daemon_options.h"
#include "core/telemetry/process_metrics.h"

namespace glasswing {
namespace {

std::optional<std::int64_t> reserve_bytes(const CameraOptions& options) {
  if (!options.reserve_mb) return std::nullopt;
  return std::llround(1e6 * *options.reserve_mb);
}

v1::RegisterRequest node_of(const CameraOptions& options, const OpenedCamera& opened) {
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_CAMERA);
  node.set_name(options.settings.name);
  const v1::GetCameraResponse described = opened.camera->describe();
  node.set_detail(fmt::format("{} {}x{} at {:.4g} fps{}", options.backend, described.camera().width_px(),
                              described.camera().height_px(), described.frame_rate_hz(),
                              opened.detail.empty() ? "" : ", " + opened.detail));
  return node;
}

std::optional<v1::Preparation> preparation_of(const Camera& camera) {
  const v1::GetCameraResponse described = camera.describe();
  return described.has_preparation() ? std::optional(described.preparation()) : std::nullopt;
}

}  // namespace

absl::Status run_camera(const CLI::App& app, DaemonOptions daemon, CameraOptions options) {
  GW_RETURN_IF_ERROR(check_name("node", options.settings.name));
  const std::filesystem::path archives = std::filesystem::path(options.data) / "archives";
  ArchiveStore store(archives, DiskRoom(archives, reserve_bytes(options)));
  GW_RETURN_IF_ERROR(store.prepare());

  GW_ASSIGN_OR_RETURN(const OpenedCamera opened, options.open(app));
  daemon.listen.clock = opened.clock;
  ManualStage manual;
  Stage& stage = options.stage == "sim" && opened.stage != nullptr ? *opened.stage : manual;

  CameraServiceImpl cameras(*opened.camera, store);
  ArchiveServiceImpl archive_service(store);
  CalibrationServiceImpl calibrations(store);
  StageServiceImpl stages(stage);
  GW_ASSIGN_OR_RETURN(StageDevice device, open_stage(options.axes, opened));
  AxisServiceImpl axes(std::move(device));
  camera_metrics();
  archive_metrics();
  const AskedMetrics disk([&] { return disk_metrics(archives); });
  return serve(daemon, {.services = {&cameras, &archive_service, &calibrations, &stages, &axes},
                        .node = node_of(options, opened),
                        .server = options.server,
                        .data = archives,
                        .preparation_of = [&] { return preparation_of(*opened.camera); },
                        .end =
                            [&] {
                              cameras.stop();
                              axes.stop();
                              archive_service.stop();
                            }});
}

}  // namespace glasswing
