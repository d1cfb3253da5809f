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

// "aravis 1280x1024 at 25 fps, trigger Line1 after 2 ms, 41.5 C, 3 frames dropped, 7 packets missing"
std::string detail_of(const CameraOptions& options, const v1::GetCameraResponse& camera) {
  std::string detail = fmt::format("{} {}x{} at {:.4g} fps", options.backend, camera.camera().width_px(),
                                   camera.camera().height_px(), camera.frame_rate_hz());
  if (!camera.trigger().empty()) detail += ", trigger " + camera.trigger();
  if (camera.line_delay_ns() > 0)
    detail += fmt::format(" after {:.4g} ms", static_cast<double>(camera.line_delay_ns()) / 1e6);
  if (camera.has_temperature_c()) detail += fmt::format(", {:.1f} C", camera.temperature_c());
  if (camera.dropped_frames() > 0) detail += fmt::format(", {} frames dropped", camera.dropped_frames());
  if (camera.missing_packets() > 0) detail += fmt::format(", {} packets missing", camera.missing_packets());
  return detail;
}

v1::RegisterRequest node_of(const CameraOptions& options) {
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_CAMERA);
  node.set_name(options.settings.name);
  return node;
}

void update(const CameraOptions& options, const OpenedCamera& opened, v1::RegisterRequest& node) {
  const v1::GetCameraResponse described = opened.camera->describe();
  node.set_detail(detail_of(options, described) + (opened.detail.empty() ? "" : ", " + opened.detail));
  if (described.has_preparation()) *node.mutable_preparation() = described.preparation();
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
                        .node = node_of(options),
                        .server = options.server,
                        .data = archives,
                        .update = [&](v1::RegisterRequest& node) { update(options, opened, node); },
                        .end =
                            [&] {
                              cameras.stop();
                              axes.stop();
                              archive_service.stop();
                            }});
}

}  // namespace glasswing
