#include "server/capture/capture_check.h"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "core/base/status.h"
#include "core/pattern/plan_cost.h"
#include "core/pattern/plan_fit.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "server/rig/calibration_plan.h"
#include "server/rig/embed_calibrations.h"
#include "server/rig/exposure_triggers.h"
#include "server/sessions/views.h"

namespace glasswing {
namespace {

constexpr double kMegabyte = 1e6;

absl::Status check_exposures(const std::vector<Step>& steps, const v1::GetCameraResponse& camera) {
  for (const Step& step : steps) {
    if (step.exposure_ms >= camera.min_exposure_ms() && step.exposure_ms <= camera.max_exposure_ms())
      continue;
    return absl::InvalidArgumentError(fmt::format("exposure_ms is {}; the camera takes {} to {} ms",
                                                  step.exposure_ms, camera.min_exposure_ms(),
                                                  camera.max_exposure_ms()));
  }
  return absl::OkStatus();
}

absl::Status check_line(const RigLinks& links, const v1::Plan& plan, const std::vector<Step>& steps) {
  std::set<double> exposures_ms;
  for (const Step& step : steps) exposures_ms.insert(step.exposure_ms);
  for (const double exposure_ms : exposures_ms) {
    for (const auto& display : links.displays)
      GW_RETURN_IF_ERROR(line_pulse(links, *display, hold_refreshes_of(plan), exposure_ms).status());
  }
  return absl::OkStatus();
}

absl::Status check_footprints(const v1::Camera& camera, const v1::Plan& plan) {
  if (plan.adapt().footprints() != "any" || camera.mosaic().empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("footprints of any shape need all colours of each pixel; camera \"{}\" measures one: leave "
                  "adapt.footprints out",
                  camera.name()));
}

// A camera that takes pictures on demand provides no times that could prove a step.
absl::Status check_patches(const v1::GetCameraResponse& camera, const v1::Plan& plan,
                           const std::vector<v1::Monitor>& monitors, const std::vector<Step>& steps) {
  if (!camera.on_demand()) return absl::OkStatus();
  const std::string& name = camera.camera().name();
  if (plan.has_calibration()) return check_calibrates(camera);
  if (is_video(plan)) {
    return absl::FailedPreconditionError(
        fmt::format("pictures of camera \"{}\" are proven only by the id patch, which videos cannot wait to "
                    "show; capture stills, or use a camera that timestamps its frames",
                    name));
  }
  for (const Step& step : steps) {
    const auto lit = std::ranges::find(monitors, step.stimulus.panel(), &v1::Monitor::name);
    if (lit == monitors.end() || lit->patch_rows() > 0) continue;
    return absl::FailedPreconditionError(fmt::format(
        "monitor \"{}\" shows no id patch, which is the only proof for pictures of camera \"{}\": start its "
        "display with --patch-rows, where the camera sees them",
        lit->name(), name));
  }
  return absl::OkStatus();
}

// Warns if the disk stores frames more slowly than the capture makes them, and the camera's memory cannot
// hold the rest. Compressed frames need less; by how much is not known in advance.
void check_disk_speed(const RigLinks& links, const v1::Plan& plan, double disk_bytes_per_second,
                      v1::EstimateSessionResponse& estimate) {
  if (disk_bytes_per_second <= 0.0 || estimate.step_count() == 0 || estimate.seconds() <= 0.0) return;
  const double bytes = static_cast<double>(estimate.bytes()), needed = bytes / estimate.seconds();
  const double held = bytes / estimate.step_count() * links.camera_info.ring_frames();
  if (bytes - disk_bytes_per_second * estimate.seconds() <= held) return;
  const double hold = std::ceil(hold_refreshes_of(plan) * needed / disk_bytes_per_second);
  estimate.add_warnings(fmt::format(
      "the disk of the {} writes {:.0f} MB/s and this capture makes up to {:.0f} MB/s of frames: once {} "
      "frames wait, the oldest are lost and their steps shown again; hold_refreshes: {:.0f} shows steps as "
      "long "
      "as the disk needs",
      links.camera->title(), disk_bytes_per_second / kMegabyte, needed / kMegabyte,
      links.camera_info.ring_frames(), hold));
}

absl::Status check_space(const RigLinks& links, const v1::Plan& plan, v1::EstimateSessionResponse& estimate) {
  const NodeLink& camera = *links.camera;
  v1::GetSpaceRequest request;
  request.set_measure_writing(true);
  v1::GetSpaceResponse space;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  GW_RETURN_IF_ERROR(from_grpc(
      v1::ArchiveService::NewStub(camera.channel())->GetSpace(&context, request, &space), camera.title()));
  estimate.set_free_bytes(space.free_bytes());
  check_disk_speed(links, plan, static_cast<double>(space.write_bytes_per_second()), estimate);
  if (estimate.bytes() <= space.free_bytes()) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "the capture makes {:.1f} MB of frames; {} has {:.1f} MB free: delete sessions there, or show fewer "
      "steps",
      static_cast<double>(estimate.bytes()) / kMegabyte, camera.title(),
      static_cast<double>(space.free_bytes()) / kMegabyte));
}

void add_warnings(const RigLinks& links, const v1::CaptureManifest& header, const std::vector<Step>& steps,
                  v1::EstimateSessionResponse& estimate) {
  if (const std::string warning = uncalibrated_warning(header); !warning.empty())
    estimate.add_warnings(warning);
  if (links.camera_info.on_demand() && links.camera_info.frame_rate_hz() > 0.0) {
    estimate.add_warnings(fmt::format(
        "camera \"{}\" takes its pictures on demand: each step is held until its picture has arrived, about "
        "{:.2g} s, whatever hold_refreshes says",
        links.camera_info.camera().name(), 1.0 / links.camera_info.frame_rate_hz()));
  }
  for (const std::string& display : links.silent_displays) {
    estimate.add_warnings(fmt::format(
        "{} does not answer; the plan does not need it, but its monitors may emit light", display));
  }
  const RigLimits rig{.monitors = {header.monitors().begin(), header.monitors().end()},
                      .camera = links.camera_info,
                      .blur_px = 0.0};
  for (const std::string& misfit : misfits(header.plan(), rig)) estimate.add_warnings(misfit);
  if (links.camera_info.on_demand()) return;  // times prove nothing
  std::set<std::string> shown;
  for (const Step& step : steps) shown.insert(step.stimulus.panel());
  for (const auto& display : links.displays) {
    for (const v1::DisplayMonitor& monitor : display->info.monitors()) {
      if (!shown.contains(monitor.name()) || display->sync.contains(monitor.name())) continue;
      estimate.add_warnings(
          fmt::format("the latency of monitor \"{}\" is not measured; the declared one is used: "
                      "glasswing calibrate sync",
                      monitor.name()));
    }
  }
}

}  // namespace

namespace {

absl::StatusOr<CheckedCapture> check_camera(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                            const v1::Plan& plan) {
  GW_ASSIGN_OR_RETURN(const RigLinks links, connect(rig, calibrations, plan.camera(), monitors_of(plan)));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> monitors, links.monitors());
  CheckedCapture checked;
  checked.info = links.camera_info;
  GW_ASSIGN_OR_RETURN(checked.steps, expand(plan, monitors));
  GW_RETURN_IF_ERROR(check_exposures(checked.steps, links.camera_info));
  GW_RETURN_IF_ERROR(check_footprints(links.camera_info.camera(), plan));
  GW_RETURN_IF_ERROR(check_line(links, plan, checked.steps));
  GW_RETURN_IF_ERROR(check_patches(links.camera_info, plan, monitors, checked.steps));
  v1::CaptureManifest header;
  for (const v1::Monitor& monitor : monitors) *header.add_monitors() = monitor;
  *header.mutable_camera() = links.camera_info.camera();
  *header.mutable_plan() = plan;
  GW_RETURN_IF_ERROR(embed_calibrations(calibrations, header));
  *checked.estimate.mutable_monitors() = header.monitors();
  *checked.estimate.mutable_camera() = header.camera();
  add_cost(plan, checked.steps, checked.estimate);
  if (links.camera_info.on_demand())
    checked.estimate.set_seconds(checked.estimate.step_count() / links.camera_info.frame_rate_hz());
  GW_RETURN_IF_ERROR(check_space(links, plan, checked.estimate));
  add_warnings(links, header, checked.steps, checked.estimate);
  return checked;
}

}  // namespace

absl::StatusOr<CheckedCapture> check_capture(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                             const v1::Plan& plan) {
  GW_RETURN_IF_ERROR(check_plan(plan));
  const std::vector<v1::Plan> plans = view_plans(plan);
  GW_ASSIGN_OR_RETURN(CheckedCapture checked, check_camera(rig, calibrations, plans.front()));
  if (plans.size() == 1) return checked;
  v1::EstimateSessionResponse& sum = checked.estimate;
  std::set<std::string> warnings(sum.warnings().begin(), sum.warnings().end());
  // Steps are held for cameras that take pictures on demand once the others have theirs.
  double shown_seconds = 0.0, held_seconds = 0.0;
  for (const v1::Plan& view : plans) {
    GW_ASSIGN_OR_RETURN(CheckedCapture own, check_camera(rig, calibrations, view));
    double& seconds = own.info.on_demand() ? held_seconds : shown_seconds;
    seconds = std::max(seconds, own.estimate.seconds());
    sum.set_seconds(shown_seconds + held_seconds);
    *sum.add_cameras() = own.estimate.camera();
    if (sum.cameras_size() == 1) continue;
    sum.set_bytes(sum.bytes() + own.estimate.bytes());
    sum.set_video_bytes(sum.video_bytes() + own.estimate.video_bytes());
    sum.set_free_bytes(std::min(sum.free_bytes(), own.estimate.free_bytes()));
    for (const std::string& warning : own.estimate.warnings()) {
      if (warnings.insert(warning).second) sum.add_warnings(warning);
    }
  }
  return checked;
}

absl::StatusOr<google::protobuf::Map<std::string, double>> positions_of(
    const google::protobuf::RepeatedPtrField<v1::Monitor>& monitors,
    const google::protobuf::Map<std::string, double>& placed) {
  google::protobuf::Map<std::string, double> positions;
  for (const v1::Monitor& monitor : monitors) {
    if (monitor.has_rail_mm()) positions[monitor.name()] = monitor.rail_mm();
  }
  const std::vector<v1::Monitor> all(monitors.begin(), monitors.end());
  for (const auto& [name, position_mm] : placed) {
    GW_RETURN_IF_ERROR(check_monitors({name}, all));
    if (!std::isfinite(position_mm)) {
      return absl::InvalidArgumentError(
          fmt::format("rail_mm of monitor \"{}\" is {}; it must be a number of mm", name, position_mm));
    }
    const auto [at, is_new] = positions.insert({name, position_mm});
    if (is_new || at->second == position_mm) continue;
    return absl::InvalidArgumentError(fmt::format(
        "rail_mm of monitor \"{}\" is {}; its rail reports that it is at {}", name, position_mm, at->second));
  }
  return positions;
}

absl::Status enter_positions(const v1::Session& session, std::vector<v1::Monitor>& monitors) {
  for (v1::Monitor& monitor : monitors) {
    const auto at = session.rail_mm().find(monitor.name());
    if (at == session.rail_mm().end()) continue;
    if (monitor.has_rail_mm() && monitor.rail_mm() != at->second) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{0}\" is at {1} mm on its rail, but the session was begun at {2} mm; move it there: "
          "glasswing rail {0}:{2}; then: glasswing retry {3}",
          monitor.name(), monitor.rail_mm(), at->second, session.name()));
    }
    monitor.set_rail_mm(at->second);
  }
  return absl::OkStatus();
}

}  // namespace glasswing
