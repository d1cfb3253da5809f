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
                 std::string name, const std::vector<v1::Session>& sessions,
                 std::optional<bool> object_confirmed, StepLog& log, const Report& report,
                 NextRound next_round)
    : rig_(rig),
      calibrations_(calibrations),
      images_(images),
      name_(std::move(name)),
      object_confirmed_(object_confirmed),
      next_round_(std::move(next_round)),
      player_(views_) {
  for (const v1::Session& session : sessions)
    views_.push_back(std::make_unique<CameraView>(session, log, report, object_confirmed.has_value()));
}

Capture::~Capture() = default;

std::vector<CaptureOutcome> Capture::run(std::stop_token stop) {
  const absl::Status status = capture(stop);
  std::vector<CaptureOutcome> outcomes;
  for (const auto& view : views_) outcomes.push_back(outcome_of(*view, status, stop.stop_requested()));
  return outcomes;
}

absl::Status Capture::capture(std::stop_token stop) {
  GW_RETURN_IF_ERROR(find_rig(stop));
  for (const auto& view : views_) GW_RETURN_IF_ERROR(open_archive(*view, stop));
  GW_RETURN_IF_ERROR(check_same_displays());
  GW_RETURN_IF_ERROR(send_images(stop));
  std::vector<bool> video_broke_off;
  for (const auto& view : views_) video_broke_off.push_back(view->video.has_run());
  std::optional<bool> object_at = object_confirmed_;
  for (bool more = true; more;) {
    GW_ASSIGN_OR_RETURN(const bool captured, capture_pending(object_at, stop));
    if (!captured) return absl::OkStatus();
    GW_ASSIGN_OR_RETURN(more, add_round(stop));
  }
  for (size_t i = 0; i < views_.size(); ++i) {
    CameraView& view = *views_[i];
    if (!view.failure.ok()) continue;
    if (is_video(session().plan())) view.video.note_lost(video_broke_off[i]);
    GW_RETURN_IF_ERROR(view.archive->seal(view.progress.session().plan(), stop));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> Capture::capture_pending(std::optional<bool>& object_at, std::stop_token stop) {
  for (const Group& group : pending_groups()) {
    const bool is_needed = std::ranges::any_of(views_, [&](const auto& view) {
      const std::set<int> pending = view->pending();
      return std::ranges::any_of(group.steps,
                                 [&](const Step& step) { return pending.contains(step.number); });
    });
    if (!is_needed) continue;  // any more: those that did have left the capture
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
  if (!session().plan().has_adapt()) return false;
  std::vector<CameraView*> views;
  std::vector<v1::Session> sessions;
  for (const auto& view : views_) {
    if (!view->failure.ok()) continue;
    views.push_back(view.get());
    sessions.push_back(view->progress.session());
  }
  if (views.empty()) return false;
  const int rounds = session().plan().rounds_size();
  const absl::StatusOr<std::vector<v1::Session>> grown = next_round_(std::move(sessions), stop);
  if (absl::IsFailedPrecondition(grown.status())) {
    // What was captured can still be solved.
    for (CameraView* view : views)
      view->progress.warn("no further images were chosen: " + std::string(grown.status().message()));
    return false;
  }
  GW_RETURN_IF_ERROR(grown.status());
  for (size_t i = 0; i < views.size(); ++i) {
    CaptureSetup& setup = views[i]->setup;
    GW_ASSIGN_OR_RETURN(setup.steps, expand((*grown)[i].plan(), setup.monitors));
    views[i]->progress.grow((*grown)[i], static_cast<int>(setup.steps.size()));
  }
  if (session().plan().rounds_size() == rounds) return false;
  for (CameraView* view : views) GW_RETURN_IF_ERROR(check_room(*view, stop));
  return true;
}

const CameraView& Capture::leading_view() const {
  const auto view = std::ranges::find_if(views_, [](const auto& each) { return each->failure.ok(); });
  return view == views_.end() ? *views_.front() : **view;
}

CaptureOutcome Capture::outcome_of(const CameraView& view, const absl::Status& status, bool stopped) const {
  using Kind = CaptureOutcome::Kind;
  if (!view.failure.ok()) return {Kind::kFailed, std::string(view.failure.message())};
  if (stopped)
    return {Kind::kStopped, view.video.has_run() ? "the video is over; what was recorded of it is kept" : ""};
  if (object_wanted_) {
    const std::string what = !*object_wanted_ ? fmt::format("{} off the stage, then", kTakeObject)
                             : is_video(session().plan())
                                 ? fmt::format("{} on the stage; to start the video", kPlaceObject)
                                 : fmt::format("{} on the stage, then", kPlaceObject);
    return {Kind::kNeedsOperator, fmt::format("{}: glasswing resume {}", what, name_)};
  }
  if (status.ok()) return {Kind::kCaptured, ""};
  const std::string reason(status.message());
  const bool no_room =
      std::ranges::any_of(views_, [](const auto& each) { return each->archive && each->archive->no_room(); });
  if (no_room) return {Kind::kNoRoom, reason};
  // ABORTED: another program took over the screens, for example after a display node was restarted.
  const bool lost =
      absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status) || absl::IsAborted(status);
  return {lost ? Kind::kNodeLost : Kind::kFailed, reason};
}

absl::Status Capture::find_rig(std::stop_token stop) {
  const v1::Plan& plan = session().plan();
  GW_ASSIGN_OR_RETURN(const RigLinks displays,
                      connect_displays(rig_, calibrations_, monitors_of(plan), stop));
  for (const auto& each : views_) {
    CameraView& view = *each;
    view.setup.links.displays = displays.displays;
    view.setup.links.silent_displays = displays.silent_displays;
    GW_RETURN_IF_ERROR(connect_camera(rig_, view.progress.session().plan().camera(), view.setup.links, stop));
    view.setup.links.note_slow_calls([&view](const std::string& who) {
      view.progress.note_waiting(who.empty() ? "" : fmt::format("{}: {}", kWaitsForAnswer, who));
    });
    GW_ASSIGN_OR_RETURN(view.setup.monitors, view.setup.links.monitors());
    GW_RETURN_IF_ERROR(enter_positions(view.progress.session(), view.setup.monitors));
    view.progress.set_archive_address(view.setup.links.camera->address());
    view.archive.emplace(view.setup.links, view.progress.session().name());
    GW_ASSIGN_OR_RETURN(view.setup.steps, expand(plan, view.setup.monitors));
  }
  return absl::OkStatus();
}

absl::Status Capture::open_archive(CameraView& view, std::stop_token stop) {
  const v1::Session& session = view.progress.session();
  v1::CaptureManifest header;
  header.set_format_version(1);
  header.set_session(session.name());
  header.set_created(session.created());
  header.set_generator(fmt::format("glasswing-server {}", kVersion));
  for (const v1::Monitor& monitor : view.setup.monitors) *header.add_monitors() = monitor;
  *header.mutable_camera() = view.setup.links.camera_info.camera();
  *header.mutable_plan() = session.plan();
  *header.mutable_axes() = session.axes();
  GW_RETURN_IF_ERROR(embed_calibrations(calibrations_, header));
  CaptureArchive& archive = *view.archive;
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, archive.open(header, stop));
  if (!session.retaking().empty()) {
    GW_RETURN_IF_ERROR(archive.drop(session.retaking(), stop));
    view.progress.note_dropped();
    GW_ASSIGN_OR_RETURN(manifest, archive.open(header, stop));
  }
  if (const std::string& from = session.empty_stage_of(); !from.empty() && manifest.frames().empty()) {
    GW_RETURN_IF_ERROR(archive.share(from, stop));
    GW_ASSIGN_OR_RETURN(manifest, archive.open(header, stop));
  }
  // A resumed session keeps the calibrations with which its archive was created.
  view.setup.header = manifest;
  view.setup.header.clear_frames();
  view.progress.resume(manifest, static_cast<int>(view.setup.steps.size()));
  GW_RETURN_IF_ERROR(check_room(view, stop));
  view.progress.report();
  return absl::OkStatus();
}

absl::Status Capture::check_same_displays() const {
  const auto calibrations = [](const CameraView& view) {
    v1::CaptureManifest only;
    *only.mutable_display_calibrations() = view.setup.header.display_calibrations();
    return only.SerializeAsString();
  };
  for (const auto& view : views_) {
    if (calibrations(*view) == calibrations(*views_.front())) continue;
    return absl::FailedPreconditionError(
        fmt::format("a monitor was calibrated between the beginnings of sessions \"{}\" and \"{}\", which "
                    "can therefore not "
                    "be captured together: finish each by its own name",
                    session().name(), view->progress.session().name()));
  }
  return absl::OkStatus();
}

absl::Status Capture::check_room(CameraView& view, std::stop_token stop) {
  return view.archive->check_room(std::ssize(view.pending()), std::move(stop));
}

absl::Status Capture::send_images(std::stop_token stop) {
  const CaptureSetup& setup = views_.front()->setup;
  std::map<std::string, std::set<std::string>> monitors_of;  // by image
  for (const Step& step : setup.steps) {
    if (!step.stimulus.image().empty()) monitors_of[step.stimulus.image()].insert(step.stimulus.panel());
  }
  for (const auto& [image, monitors] : monitors_of) {
    GW_RETURN_IF_ERROR(check_name("image", image));
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(images_.path(image)));
    if (image_name(bytes) != image) {
      return absl::DataLossError(fmt::format("{} is damaged: upload the photo again, with a new session",
                                             images_.path(image).string()));
    }
    for (const auto& display : setup.links.displays) {
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

std::vector<Capture::Group> Capture::pending_groups() const {
  // So that drafts are available early.
  const bool drafted = session().solve_follows();
  const std::vector<Step>& steps = leading_view().setup.steps;
  std::set<int> pending;  // for any camera
  for (const auto& view : views_) pending.merge(view->pending());
  std::vector<Group> groups;
  for (const Step& step : drafted ? in_order_of_showing(steps) : steps) {
    if (!pending.contains(step.number)) continue;
    if (groups.empty() || groups.back().object != step.object ||
        groups.back().exposure_ms != step.exposure_ms) {
      groups.push_back({.object = step.object, .exposure_ms = step.exposure_ms, .steps = {}});
    }
    groups.back().steps.push_back(step);
  }
  return groups;
}

absl::StatusOr<bool> Capture::move_object(std::optional<bool> at, bool present, std::stop_token stop) {
  // The object is moved by whichever node has the stage.
  bool needs_operator = true;
  for (const auto& view : views_) {
    v1::MoveObjectRequest request;
    request.set_present(present);
    request.set_request_id(random_token());
    v1::MoveObjectResponse response;
    NodeLink& camera = *view->setup.links.camera;
    const auto stage = v1::StageService::NewStub(camera.channel());
    GW_RETURN_IF_ERROR(camera.call("move the object", stop, [&](grpc::ClientContext& context) {
      return stage->MoveObject(&context, request, &response);
    }));
    needs_operator = needs_operator && response.needs_operator();
  }
  // In a series the object stands where the session before left it.
  const bool stands = present && !at && !session().empty_stage_of().empty();
  return stands || !needs_operator;
}

absl::Status Capture::place_object(std::stop_token stop) {
  const AxisPositions& pose = session().axes();
  if (pose.empty() || object_placed_) return absl::OkStatus();
  // By every node whose stage has these axes; the check before the capture found one.
  absl::Status placed;
  int count = 0;
  for (const auto& view : views_) {
    v1::MoveAxesRequest request;
    *request.mutable_positions() = pose;
    const absl::Status moved = move_axes(*view->setup.links.camera, std::move(request), stop).status();
    if (moved.ok()) ++count;
    if (!moved.ok() && !absl::IsInvalidArgument(moved)) return moved;
    placed.Update(moved);
  }
  if (count == 0) return placed;
  object_placed_ = true;
  return absl::OkStatus();
}

absl::Status Capture::capture_group(const Group& group, std::stop_token stop) {
  for (const bool on_demand : {false, true}) GW_RETURN_IF_ERROR(capture_group(group, on_demand, stop));
  return absl::OkStatus();
}

absl::Status Capture::capture_group(const Group& group, bool on_demand, std::stop_token stop) {
  Cameras cameras;
  const absl::Cleanup end = [&cameras] {
    for (const auto& camera : cameras) camera->view().progress.end_group();
  };
  for (const auto& view : views_) {
    if (view->on_demand() != on_demand) continue;
    const std::set<int> pending = view->pending();
    std::vector<Step> steps;
    bool films = false;
    for (const Step& step : group.steps) {
      if (!pending.contains(step.number)) continue;
      const bool of_video = view->video.is_video_frame(step);
      films = films || of_video;
      if (!of_video) steps.push_back(step);
    }
    if (steps.empty() && !films) continue;
    view->progress.begin_group();
    cameras.push_back(std::make_unique<GroupCapture>(*view, player_, group.exposure_ms));
    cameras.back()->begin(std::move(steps));
  }
  if (cameras.empty()) return absl::OkStatus();
  for (const auto& camera : cameras) GW_RETURN_IF_ERROR(camera->wait_running(stop));
  GW_RETURN_IF_ERROR(player_.measure_clocks(8, stop));
  GW_RETURN_IF_ERROR(prove(group, cameras, stop));
  std::vector<Step> video;
  for (const Step& step : group.steps) {
    if (views_.front()->video.is_video_frame(step)) video.push_back(step);
  }
  return video.empty() ? absl::OkStatus() : take_video(video, cameras, stop);
}

absl::Status Capture::leave(GroupCapture& camera, const absl::Status& status) const {
  if (views_.size() == 1 || !absl::IsFailedPrecondition(status)) return status;
  camera.view().failure = status;
  camera.stop();
  return absl::OkStatus();
}

absl::Status Capture::prove(const Group& group, Cameras& cameras, std::stop_token stop) {
  const bool takes_video = std::ranges::any_of(
      group.steps, [this](const Step& step) { return views_.front()->video.is_video_frame(step); });
  while (true) {
    Watchers watchers;
    std::set<int> wanted;
    for (const auto& camera : cameras) {
      if (!camera->view().failure.ok()) continue;
      absl::StatusOr<std::vector<Step>> needed = camera->next_showing(stop);
      if (!needed.ok()) {
        GW_RETURN_IF_ERROR(leave(*camera, needed.status()));
        continue;
      }
      if (needed->empty()) {
        if (!takes_video) camera->stop();
        continue;
      }
      for (const Step& step : *needed) wanted.insert(step.number);
      watchers.emplace_back(camera.get(), *std::move(needed));
    }
    if (watchers.empty()) return absl::OkStatus();
    std::vector<Step> steps;
    std::ranges::copy_if(group.steps, std::back_inserter(steps),
                         [&](const Step& step) { return wanted.contains(step.number); });
    const bool on_demand = watchers.front().first->view().on_demand();
    GW_RETURN_IF_ERROR(show(with_repeats(steps, on_demand), watchers, stop));
    for (const auto& [camera, needed] : watchers) {
      if (camera->view().failure.ok()) GW_RETURN_IF_ERROR(leave(*camera, camera->note_showing(stop)));
    }
  }
}

std::vector<Step> Capture::with_repeats(const std::vector<Step>& steps, bool on_demand) {
  // A repeat's frame is not judged by its pixels, which are the only proof without timestamps.
  if (on_demand) return steps;
  std::vector<Step> shown;
  for (const auto& view : views_) {
    if (view->on_demand()) continue;
    shown = view->watch.with_repeats(steps, hold_refreshes_of(session().plan()), view->progress.proven());
  }
  return shown;
}

absl::Status Capture::show(const std::vector<Step>& shown, const Watchers& watchers, std::stop_token stop) {
  std::vector<Watching> watching;
  for (const auto& [camera, needed] : watchers) watching.push_back(camera->watch(shown, needed, stop));
  GW_RETURN_IF_ERROR(player_.play(shown, watching, stop));
  if (stop.stop_requested()) return absl::CancelledError("stopped");
  for (size_t i = 0; i < watchers.size(); ++i) {
    GroupCapture& camera = *watchers[i].first;
    GW_RETURN_IF_ERROR(watching[i].failure.ok() ? camera.end_showing(stop)
                                                : leave(camera, watching[i].failure));
  }
  return absl::OkStatus();
}

absl::Status Capture::take_video(const std::vector<Step>& frames, Cameras& cameras, std::stop_token stop) {
  Watchers watchers;
  for (const auto& camera : cameras) {
    if (!camera->view().failure.ok() || camera->view().video.has_run()) continue;
    camera->begin_once(frames);
    watchers.emplace_back(camera.get(), frames);
  }
  if (watchers.empty()) return absl::OkStatus();
  GW_RETURN_IF_ERROR(show(frames, watchers, stop));
  for (const auto& [camera, needed] : watchers) {
    CameraView& view = camera->view();
    GW_RETURN_IF_ERROR(leave(*camera, view.video.check_taken(frames, *camera, stop)));
    view.progress.update_seconds();
  }
  return absl::OkStatus();
}

}  // namespace glasswing
