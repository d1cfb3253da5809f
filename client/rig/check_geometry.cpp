#include "client/rig/check_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>

#include "client/capture/stage_axes.h"
#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/sessions/matte_input.h"
#include "core/axis/object_pose.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/geometry/monitor_sightings.h"
#include "core/geometry/pose_check.h"
#include "core/geometry/rig_geometry.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

// `camera`: seen by it; empty: by any.
absl::StatusOr<std::string> newest_solved(const Client& client, const std::string& camera) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                      call_pages(server, &v1::SessionService::Stub::ListSessions, {}));
  for (const v1::Session& session : listed.sessions()) {
    if (session.frame_count() != 0) continue;
    if (camera.empty() && session.matte_ready()) return session.name();
    if (camera.empty() || (!session.matte_ready() && session.views().empty())) continue;
    const absl::StatusOr<v1::Session> seen = session_of(client, session.name(), camera);
    if (seen.ok() && seen->matte_ready()) return seen->name();
  }
  return absl::NotFoundError(
      fmt::format("no solved session{} shows where the monitors are; capture and solve one, or name a matte "
                  "with --session",
                  camera.empty() ? "" : fmt::format(" of camera \"{}\"", camera)));
}

struct CameraFile {
  std::string camera, file;  // camera: empty: not named
};

absl::StatusOr<std::vector<CameraFile>> parse_files(const std::vector<std::string>& texts) {
  std::vector<CameraFile> files;
  for (const std::string& text : texts) {
    const size_t equals = text.find('=');
    CameraFile named{.camera = "", .file = text};
    if (equals != std::string::npos && check_name("camera", text.substr(0, equals)).ok())
      named = {.camera = text.substr(0, equals), .file = text.substr(equals + 1)};
    if (texts.size() > 1 && named.camera.empty()) {
      return absl::InvalidArgumentError(fmt::format(
          "--geometry is \"{}\"; where it is repeated it must be CAMERA=FILE, such as left=left.txtpb",
          text));
    }
    files.push_back(std::move(named));
  }
  return files;
}

// The session, or matte file, that the camera has seen.
absl::StatusOr<std::string> seen_by(const Client& client, const std::string& camera,
                                    const std::string& session) {
  if (session.empty()) return newest_solved(client, camera);
  if (camera.empty() || MatteInput{session}.is_file()) return session;
  return session_name_of(client, session, camera);
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
std::vector<v1::Finding> check_axes(const Client& client, const CameraFile& named,
                                    const v1::RigGeometry& geometry) {
  const std::string& file = named.file;
  std::vector<v1::Finding> findings;
  if (geometry.axes().empty()) return findings;
  const absl::StatusOr<std::vector<v1::Axis>> stage = read_axes(client, named.camera);
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

absl::StatusOr<std::vector<v1::Finding>> check_file(const Client& client, const CameraFile& named,
                                                    const std::string& session) {
  const std::string& file = named.file;
  GW_ASSIGN_OR_RETURN(const v1::RigGeometry geometry, read_geometry(file));
  MatteInput input;
  GW_ASSIGN_OR_RETURN(input.name, seen_by(client, named.camera, session));
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
  for (v1::Finding& finding : check_axes(client, named, geometry)) findings.push_back(std::move(finding));
  return findings;
}

}  // namespace

absl::StatusOr<std::vector<v1::Finding>> check_rig_geometry(const Client& client,
                                                            const std::vector<std::string>& files,
                                                            const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::vector<CameraFile> cameras, parse_files(files));
  std::vector<v1::Finding> findings;
  for (const CameraFile& named : cameras) {
    GW_ASSIGN_OR_RETURN(std::vector<v1::Finding> found, check_file(client, named, session));
    std::ranges::move(found, std::back_inserter(findings));
  }
  return findings;
}

}  // namespace glasswing
