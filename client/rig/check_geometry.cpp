#include "client/rig/check_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "client/capture/stage_axes.h"
#include "client/cli/rpc.h"
#include "client/sessions/matte_input.h"
#include "core/axis/object_pose.h"
#include "core/base/status.h"
#include "core/geometry/monitor_sightings.h"
#include "core/geometry/pose_check.h"
#include "core/geometry/rig_geometry.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

absl::StatusOr<std::string> newest_solved(const Client& client) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                      call_pages(server, &v1::SessionService::Stub::ListSessions, {}));
  for (const v1::Session& session : listed.sessions()) {
    if (session.matte_ready() && session.frame_count() == 0) return session.name();
  }
  return absl::NotFoundError(
      "no solved session shows where the monitors are; capture and solve one, or name a matte with "
      "--session");
}

struct Checked {
  const v1::MonitorPose* pose = nullptr;
  PoseCheck check;
};

// The pose with which the view is compared.
absl::StatusOr<Checked> checked(const v1::RigGeometry& geometry, const MonitorView& view) {
  std::vector<const v1::MonitorPose*> poses;
  for (const v1::MonitorPose& pose : geometry.monitors()) {
    if (pose.monitor().empty() || pose.monitor() == view.monitor) poses.push_back(&pose);
  }
  const auto keep = [&poses](const auto& suits) {
    if (std::ranges::any_of(poses, suits))
      std::erase_if(poses, [&](const auto* pose) { return !suits(pose); });
  };
  keep([&](const v1::MonitorPose* pose) { return pose->name() == view.session; });
  keep([&](const v1::MonitorPose* pose) {
    return view.rail_mm && pose->has_rail_mm() && pose->rail_mm() == *view.rail_mm;
  });
  if (poses.empty()) {
    return absl::NotFoundError(fmt::format("the geometry has no pose for monitor \"{}\"", view.monitor));
  }
  std::optional<Checked> best;
  absl::Status unsuited;
  for (const v1::MonitorPose* pose : poses) {
    const absl::StatusOr<PoseCheck> check = check_pose(geometry.camera(), *pose, view);
    unsuited.Update(check.status());
    if (check.ok() && (!best || check->off_px < best->check.off_px)) best = Checked{pose, *check};
  }
  if (!best) return unsuited;
  return *best;
}

v1::Finding finding_of(const std::string& file, const MonitorView& view,
                       const absl::StatusOr<Checked>& found) {
  v1::Finding finding;
  finding.set_subject("geometry");
  if (!found.ok()) {
    finding.set_level(v1::FINDING_LEVEL_PROBLEM);
    finding.set_text(std::string(found.status().message()));
    return finding;
  }
  const PoseCheck& check = found->check;
  finding.set_level(check.has_moved() ? v1::FINDING_LEVEL_PROBLEM : v1::FINDING_LEVEL_OK);
  finding.set_text(fmt::format(
      "monitor {} {} as in pose {} of {}: session {} sees its points {:.2f} px from there, by {:.2f} mm "
      "({:+.2f} mm away from the camera) and {:.2f} degrees",
      view.monitor, check.has_moved() ? "does not stand" : "stands", found->pose->name(), file, view.session,
      check.off_px, check.shift_mm, check.away_mm, check.turn_deg));
  if (check.has_moved())
    finding.set_advice(
        "the monitor or the camera has moved; put it back, or calibrate again: glasswing calibrate geometry");
  return finding;
}

// Whether the stage still has the axes of the geometry, and how well they are known.
std::vector<v1::Finding> check_axes(const Client& client, const std::string& file,
                                    const v1::RigGeometry& geometry) {
  std::vector<v1::Finding> findings;
  if (geometry.axes().empty()) return findings;
  const absl::StatusOr<std::vector<v1::Axis>> stage = read_axes(client, "");
  for (const v1::AxisGeometry& axis : geometry.axes()) {
    v1::Finding& finding = findings.emplace_back();
    finding.set_subject("axis");
    finding.set_level(v1::FINDING_LEVEL_PROBLEM);
    if (!stage.ok()) {
      finding.set_text(std::string(stage.status().message()));
      continue;
    }
    const auto found = std::ranges::find(*stage, axis.name(), &v1::Axis::name);
    if (found == stage->end() || found->unit() != "deg") {
      finding.set_text(
          fmt::format("the stage has no turning axis \"{}\", which {} describes", axis.name(), file));
      finding.set_advice("glasswing stage lists the axes; measure this one again: glasswing calibrate axis");
      continue;
    }
    const AxisErrors errors = errors_of(axis);
    finding.set_level(axis.warnings().empty() ? v1::FINDING_LEVEL_OK : v1::FINDING_LEVEL_WARNING);
    finding.set_text(fmt::format("axis {} of {} is known to {:.3f} degrees and {:.3f} mm", axis.name(), file,
                                 errors.direction_sd_deg, errors.point_sd_mm));
    for (const std::string& warning : axis.warnings()) finding.set_text(finding.text() + "; " + warning);
    if (!axis.warnings().empty()) finding.set_advice("measure it again: glasswing calibrate axis");
  }
  return findings;
}

}  // namespace

absl::StatusOr<std::vector<v1::Finding>> check_rig_geometry(const Client& client, const std::string& file,
                                                            const std::string& session) {
  GW_ASSIGN_OR_RETURN(const v1::RigGeometry geometry, read_geometry(file));
  MatteInput input{session};
  if (session.empty()) {
    GW_ASSIGN_OR_RETURN(input.name, newest_solved(client));
  }
  std::error_code ignored;
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> matte,
                      input.open(client, std::filesystem::temp_directory_path(ignored) / "glasswing-doctor"));
  const absl::StatusOr<StageView> stage = sightings_in(matte->bytes());
  if (!stage.ok()) return input.error(stage.status());
  const v1::CameraGeometry& camera = geometry.camera();
  if (camera.width_px() != stage->width_px || camera.height_px() != stage->height_px) {
    return absl::InvalidArgumentError(fmt::format("{} is for a camera of {}x{} px, {} for one of {}x{}", file,
                                                  camera.width_px(), camera.height_px(), input.name,
                                                  stage->width_px, stage->height_px));
  }
  std::vector<v1::Finding> findings;
  for (const MonitorView& view : stage->monitors)
    findings.push_back(finding_of(file, view, checked(geometry, view)));
  for (v1::Finding& finding : check_axes(client, file, geometry)) findings.push_back(std::move(finding));
  return findings;
}

}  // namespace glasswing
