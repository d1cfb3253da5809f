#include "server/capture/capture.h"

#include <absl/cleanup/cleanup.h>
#include <fmt/format.h>

#include <algorithm>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/version.h"
#include "core/file/file.h"
#include "core/pattern/draft_stages.h"
#include "core/service/service.h"
#include "glasswing/v1/stage_service.grpc.pb.h"
#include "server/capture/capture_check.h"
#include "server/capture/group_capture.h"
#include "server/rig/embed_calibrations.h"
#include "server/rig/stage_axes.h"
#include "server/sessions/session_state.h"
#include "server/storage/image_name.h"

namespace glasswing {
namespace {

grpc::Status send_image(const std::string& bytes, grpc::ClientContext& context,
                        v1::DisplayService::Stub& display) {
  v1::PutImageResponse response;
  const auto writer = display.PutImage(&context, &response);
  for (size_t at = 0; at < bytes.size(); at += kChunkBytes) {
    v1::PutImageRequest chunk;
    chunk.set_chunk(bytes.substr(at, kChunkBytes));
    if (!writer->Write(chunk)) break;
  }
  writer->WritesDone();
  return writer->Finish();
}

}  // namespace

Capture::Capture(const NodeRegistry& rig, const CalibrationStore& calibrations, const ImageFiles& images,
                 v1::Session session, std::optional<bool> object_confirmed, StepLog& log,
                 std::function<void(const v1::Session&)> report, NextRound next_round)
    : rig_(rig),
      calibrations_(calibrations),
      images_(images),
      object_confirmed_(object_confirmed),
      next_round_(std::move(next_round)),
      progress_(std::move(session), log, std::move(report)),
      video_(setup_, progress_),
      player_(setup_, progress_),
      watch_(setup_, object_confirmed.has_value()) {}

Capture::~Capture() = default;

CaptureOutcome Capture::run(std::stop_token stop) {
  const absl::Status status = capture(stop);
  return outcome_of(status, stop.stop_requested());
}

absl::Status Capture::capture(std::stop_token stop) {
  GW_RETURN_IF_ERROR(find_rig(stop));
  GW_RETURN_IF_ERROR(open_archive(stop));
  GW_RETURN_IF_ERROR(send_images(stop));
  const bool video_broke_off = video_.has_run();
  std::optional<bool> object_at = object_confirmed_;
  for (bool more = true; more;) {
    GW_ASSIGN_OR_RETURN(const bool captured, capture_pending(object_at, stop));
    if (!captured) return absl::OkStatus();
    GW_ASSIGN_OR_RETURN(more, add_round(stop));
  }
  if (is_video(progress_.session().plan())) video_.note_lost(video_broke_off);
  return archive_->seal(progress_.session().plan(), stop);
}

absl::StatusOr<bool> Capture::capture_pending(std::optional<bool>& object_at, std::stop_token stop) {
  for (const Group& group : pending_groups()) {
    if (object_at != group.object) {
      GW_ASSIGN_OR_RETURN(const bool moved, move_object(object_at, group.object, stop));
      if (!moved) {
        object_wanted_ = group.object;
        return false;
      }
      object_at = group.object;
    }
    if (group.object) GW_RETURN_IF_ERROR(place_object(stop));
    GW_RETURN_IF_ERROR(capture_group(group, stop));
  }
  return true;
}

absl::StatusOr<bool> Capture::add_round(std::stop_token stop) {
  if (!progress_.session().plan().has_adapt()) return false;
  const int rounds = progress_.session().plan().rounds_size();
  const absl::StatusOr<v1::Session> grown = next_round_(progress_.session(), stop);
  if (absl::IsFailedPrecondition(grown.status())) {
    // What was captured can still be solved.
    progress_.warn("no further images were chosen: " + std::string(grown.status().message()));
    return false;
  }
  GW_RETURN_IF_ERROR(grown.status());
  GW_ASSIGN_OR_RETURN(setup_.steps, expand(grown->plan(), setup_.monitors));
  progress_.grow(*grown, static_cast<int>(setup_.steps.size()));
  if (grown->plan().rounds_size() == rounds) return false;
  GW_RETURN_IF_ERROR(check_room(stop));
  return true;
}

CaptureOutcome Capture::outcome_of(const absl::Status& status, bool stopped) const {
  using Kind = CaptureOutcome::Kind;
  if (stopped)
    return {Kind::kStopped, video_.has_run() ? "the video is over; what was recorded of it is kept" : ""};
  if (object_wanted_) {
    const v1::Session& session = progress_.session();
    const std::string what = !*object_wanted_ ? fmt::format("{} off the stage, then", kTakeObject)
                             : is_video(session.plan())
                                 ? fmt::format("{} on the stage; to start the video", kPlaceObject)
                                 : fmt::format("{} on the stage, then", kPlaceObject);
    return {Kind::kNeedsOperator, fmt::format("{}: glasswing resume {}", what, session.name())};
  }
  if (status.ok()) return {Kind::kCaptured, ""};
  const std::string reason(status.message());
  if (archive_ && archive_->no_room()) return {Kind::kNoRoom, reason};
  // ABORTED: another program took over the screens, for example after a display node was restarted.
  const bool lost =
      absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsAborted(status);
  return {lost ? Kind::kNodeLost : Kind::kFailed, reason};
}

absl::Status Capture::find_rig(std::stop_token stop) {
  const v1::Plan& plan = progress_.session().plan();
  GW_ASSIGN_OR_RETURN(setup_.links,
                      connect(rig_, calibrations_, plan.camera(), monitors_of(plan), std::move(stop)));
  setup_.links.note_slow_calls([this](const std::string& who) {
    progress_.note_waiting(who.empty() ? "" : fmt::format("{}: {}", kWaitsForAnswer, who));
  });
  GW_ASSIGN_OR_RETURN(setup_.monitors, setup_.links.monitors());
  GW_RETURN_IF_ERROR(enter_positions(progress_.session(), setup_.monitors));
  progress_.set_archive_address(setup_.links.camera->address());
  archive_.emplace(setup_.links, progress_.session().name());
  GW_ASSIGN_OR_RETURN(setup_.steps, expand(plan, setup_.monitors));
  return absl::OkStatus();
}

absl::Status Capture::open_archive(std::stop_token stop) {
  const v1::Session& session = progress_.session();
  v1::CaptureManifest header;
  header.set_format_version(1);
  header.set_session(session.name());
  header.set_created(session.created());
  header.set_generator(fmt::format("glasswing-server {}", kVersion));
  for (const v1::Monitor& monitor : setup_.monitors) *header.add_monitors() = monitor;
  *header.mutable_camera() = setup_.links.camera_info.camera();
  *header.mutable_plan() = session.plan();
  *header.mutable_axes() = session.axes();
  GW_RETURN_IF_ERROR(embed_calibrations(calibrations_, header));
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, archive_->open(header, stop));
  if (!session.retaking().empty()) {
    GW_RETURN_IF_ERROR(archive_->drop(session.retaking(), stop));
    progress_.note_dropped();
    GW_ASSIGN_OR_RETURN(manifest, archive_->open(header, stop));
  }
  if (const std::string& from = session.empty_stage_of(); !from.empty() && manifest.frames().empty()) {
    GW_RETURN_IF_ERROR(archive_->share(from, stop));
    GW_ASSIGN_OR_RETURN(manifest, archive_->open(header, stop));
  }
  // A resumed session keeps the calibrations with which its archive was created.
  setup_.header = manifest;
  setup_.header.clear_frames();
  progress_.resume(manifest, static_cast<int>(setup_.steps.size()));
  GW_RETURN_IF_ERROR(check_room(stop));
  progress_.report();
  return absl::OkStatus();
}

absl::Status Capture::check_room(std::stop_token stop) {
  const bool video_has_run = video_.has_run();
  return archive_->check_room(
      std::ranges::count_if(setup_.steps, [&](const Step& step) { return is_pending(step, video_has_run); }),
      std::move(stop));
}

absl::Status Capture::send_images(std::stop_token stop) {
  std::map<std::string, std::set<std::string>> monitors_of;  // by image
  for (const Step& step : setup_.steps) {
    if (!step.stimulus.image().empty()) monitors_of[step.stimulus.image()].insert(step.stimulus.panel());
  }
  for (const auto& [image, monitors] : monitors_of) {
    GW_RETURN_IF_ERROR(check_name("image", image));
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(images_.path(image)));
    if (image_name(bytes) != image) {
      return absl::DataLossError(fmt::format("{} is damaged: upload the photo again, with a new session",
                                             images_.path(image).string()));
    }
    for (const auto& display : setup_.links.displays) {
      const bool shows_it = std::ranges::any_of(
          monitors, [&](const std::string& monitor) { return display->monitor(monitor) != nullptr; });
      if (!shows_it) continue;
      GW_RETURN_IF_ERROR(display->link.call("take a picture", stop, [&](grpc::ClientContext& context) {
        return send_image(bytes, context, *display->stub);
      }));
    }
  }
  return absl::OkStatus();
}

bool Capture::is_pending(const Step& step, bool video_has_run) const {
  return !progress_.is_proven(step.number) && !(step.object && video_has_run);
}

std::vector<Capture::Group> Capture::pending_groups() const {
  const bool video_has_run = video_.has_run();
  // So that drafts are available early.
  const bool drafted = progress_.session().solve_follows();
  std::vector<Group> groups;
  for (const Step& step : drafted ? in_order_of_showing(setup_.steps) : setup_.steps) {
    if (!is_pending(step, video_has_run)) continue;
    if (groups.empty() || groups.back().object != step.object ||
        groups.back().exposure_ms != step.exposure_ms) {
      groups.push_back({.object = step.object, .exposure_ms = step.exposure_ms, .steps = {}});
    }
    groups.back().steps.push_back(step);
  }
  return groups;
}

absl::StatusOr<bool> Capture::move_object(std::optional<bool> at, bool present, std::stop_token stop) {
  v1::MoveObjectRequest request;
  request.set_present(present);
  request.set_request_id(random_token());
  v1::MoveObjectResponse response;
  NodeLink& camera = *setup_.links.camera;
  const auto stage = v1::StageService::NewStub(camera.channel());
  GW_RETURN_IF_ERROR(camera.call("move the object", std::move(stop), [&](grpc::ClientContext& context) {
    return stage->MoveObject(&context, request, &response);
  }));
  // In a series the object stands where the session before left it.
  const bool stands = present && !at && !progress_.session().empty_stage_of().empty();
  return stands || !response.needs_operator();
}

absl::Status Capture::place_object(std::stop_token stop) {
  const AxisPositions& pose = progress_.session().axes();
  if (pose.empty() || object_placed_) return absl::OkStatus();
  v1::MoveAxesRequest request;
  *request.mutable_positions() = pose;
  GW_RETURN_IF_ERROR(move_axes(*setup_.links.camera, std::move(request), std::move(stop)).status());
  object_placed_ = true;
  return absl::OkStatus();
}

absl::Status Capture::capture_group(const Group& group, std::stop_token stop) {
  progress_.begin_group();
  const absl::Cleanup end = [this] { progress_.end_group(); };
  GroupCapture capturing(setup_, *archive_, player_, progress_, watch_, patches_given_up_, group.exposure_ms);
  GW_RETURN_IF_ERROR(capturing.start(stop));
  std::vector<Step> steps, video;
  for (const Step& step : group.steps) (video_.is_video_frame(step) ? video : steps).push_back(step);
  GW_RETURN_IF_ERROR(capturing.prove(std::move(steps), stop));
  if (video.empty()) return absl::OkStatus();
  GW_RETURN_IF_ERROR(video_.take(video, capturing, stop));
  progress_.update_seconds();
  return absl::OkStatus();
}

}  // namespace glasswing
