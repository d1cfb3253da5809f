#include "server/server.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/service.h"
#include "server/embed_calibrations.h"
#include "server/session_facts.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kNodeGrace(30);  // how long a capture waits for a lost node before it pauses

absl::StatusOr<fs::path> directory_below(const fs::path& data, const char* name) {
  std::error_code error;
  fs::create_directories(data / name, error);
  if (error)
    return absl::ErrnoToStatus(error.value(), fmt::format("cannot create {}", (data / name).string()));
  return data / name;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> Server::open(const fs::path& data) {
  std::unique_ptr<Server> server(new Server(data));
  for (const char* name : {"images", "mattes", "tiles"})
    GW_RETURN_IF_ERROR(directory_below(data, name).status());
  GW_ASSIGN_OR_RETURN(server->catalogue_, Catalogue::open(data / "catalogue.sqlite"));
  GW_ASSIGN_OR_RETURN(server->calibrations_, CalibrationStore::open(data));
  GW_ASSIGN_OR_RETURN(server->jobs_, JobStore::open(data / "jobs.sqlite"));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, server->catalogue_->list());
  for (v1::Session session : sessions) {
    if (session.state() != v1::SESSION_STATE_CAPTURING) continue;
    session.set_state(v1::SESSION_STATE_PAUSED);
    session.set_reason(
        fmt::format("the server was restarted; go on with: glasswing resume {}", session.name()));
    GW_RETURN_IF_ERROR(server->catalogue_->update(session));
  }
  return server;
}

Server::~Server() {
  {
    const std::lock_guard lock(mutex_);
    if (!capturing_.empty() && wish_ == Wish::kNone) wish_ = Wish::kPause;
    capture_thread_.request_stop();
  }
  join_capture();
}

void Server::join_capture() {
  if (capture_thread_.joinable()) capture_thread_.join();
}

absl::Status Server::check_rig_is_free() const {
  if (!capturing_.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("the rig is held by session \"{}\"; wait for it or cancel it", capturing_));
  }
  if (!measuring_.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("the rig is held by \"{}\"; wait until it is done", measuring_));
  }
  return absl::OkStatus();
}

absl::StatusOr<Server::RigHold> Server::hold_rig(const std::string& what) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(check_rig_is_free());
  measuring_ = what;
  return RigHold(this);
}

void Server::Release::operator()(Server* server) const {
  const std::lock_guard lock(server->mutex_);
  server->measuring_.clear();
}

void Server::announce() {
  ++change_count_;
  changed_.notify_all();
}

absl::Status Server::change(const v1::Session& session) {
  GW_RETURN_IF_ERROR(catalogue_->update(session));
  live_.erase(session.name());
  announce();
  return absl::OkStatus();
}

std::int64_t Server::wait_change(std::int64_t seen, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return change_count_ > seen; });
  return change_count_;
}

absl::StatusOr<v1::Session> Server::find(const std::string& name) {
  {
    const std::lock_guard lock(mutex_);
    const auto live = live_.find(name);
    if (live != live_.end()) return live->second;
  }
  return catalogue_->find(name);
}

absl::StatusOr<std::vector<v1::Session>> Server::list() {
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> sessions, catalogue_->list());
  for (v1::Session& session : sessions) {
    const absl::StatusOr<v1::Session> live = find(session.name());
    if (live.ok()) session = *live;
    session.clear_plan();
  }
  return sessions;
}

absl::StatusOr<std::string> Server::store_image(const std::string& png) {
  std::string name = checksum_of(png);
  name.erase(std::remove(name.begin(), name.end(), ':'), name.end());
  GW_RETURN_IF_ERROR(write_file_durably(data_ / "images" / name, png));
  return name;
}

absl::StatusOr<v1::Session> Server::create(const v1::CreateSessionRequest& request) {
  const absl::StatusOr<v1::Session> before = catalogue_->find_request(request.request_id());
  if (!absl::IsNotFound(before.status())) return before;
  GW_RETURN_IF_ERROR(check_plan(request.plan()));
  GW_ASSIGN_OR_RETURN(const RigLinks links, connect(rig_, *calibrations_));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> monitors, links.monitors());
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(request.plan(), monitors));
  const v1::GetCameraResponse& camera = links.camera_info;
  for (const Step& step : steps) {
    if (step.exposure_ms < camera.min_exposure_ms() || step.exposure_ms > camera.max_exposure_ms()) {
      return absl::InvalidArgumentError(fmt::format("exposure_ms is {}; the camera takes {} to {} ms",
                                                    step.exposure_ms, camera.min_exposure_ms(),
                                                    camera.max_exposure_ms()));
    }
    const std::string& image = step.stimulus.image();
    if (!image.empty() && (!check_name("image", image).ok() || !fs::exists(data_ / "images" / image))) {
      return absl::InvalidArgumentError(
          fmt::format("photo \"{}\" has not been uploaded", step.stimulus.name()));
    }
  }
  v1::CaptureManifest header;
  for (const v1::Monitor& monitor : monitors) *header.add_monitors() = monitor;
  *header.mutable_camera() = camera.camera();
  *header.mutable_plan() = request.plan();
  GW_RETURN_IF_ERROR(embed_calibrations(*calibrations_, header));
  v1::Session session;
  session.set_name(request.name());
  session.set_created(utc_now_rfc3339());
  if (session.name().empty()) {
    std::string stamp = session.created();
    std::erase_if(stamp, [](char c) { return c == '-' || c == ':' || c == 'Z'; });
    std::replace(stamp.begin(), stamp.end(), 'T', '-');
    session.set_name(stamp);
    for (int i = 2; catalogue_->find(session.name()).ok(); ++i)
      session.set_name(fmt::format("{}-{}", stamp, i));
  }
  GW_RETURN_IF_ERROR(check_name("session", session.name()));
  *session.mutable_plan() = request.plan();
  session.set_method(request.plan().method());
  if (is_video(request.plan())) session.set_frame_count(ramp_frames_of(request.plan().ramp()));
  session.set_step_count(static_cast<int>(steps.size()));
  session.set_pixel_count(static_cast<std::int64_t>(camera.camera().width_px()) *
                          camera.camera().height_px());
  session.set_state(v1::SESSION_STATE_CREATED);

  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(check_rig_is_free());
  GW_RETURN_IF_ERROR(catalogue_->insert(session, request.request_id()));
  start_capture(session);
  return live_.at(session.name());
}

void Server::start_capture(const v1::Session& created) {
  v1::Session session = created;
  session.set_state(v1::SESSION_STATE_CAPTURING);
  session.clear_reason();
  std::optional<bool> confirmed;
  if (const auto asked = operator_asked_.find(session.name()); asked != operator_asked_.end()) {
    confirmed = asked->second;
    operator_asked_.erase(asked);
  }
  // An error here is met again, and told, when the capture's end is written.
  (void)catalogue_->update(session);
  live_[session.name()] = session;
  capturing_ = session.name();
  wish_ = Wish::kNone;
  announce();
  spdlog::info("capturing session={} steps={}", session.name(), session.step_count());
  if (capture_thread_.joinable()) capture_thread_.join();  // it has ended: capturing_ was empty
  capture_thread_ = std::jthread(
      [this, session, confirmed](std::stop_token stop) { capture_until_done(session, confirmed, stop); });
}

void Server::capture_until_done(v1::Session session, std::optional<bool> object_confirmed,
                                std::stop_token stop) {
  using Kind = CaptureOutcome::Kind;
  const auto report = [this, &session](const v1::Session& progress) {
    const std::lock_guard lock(mutex_);
    session = progress;
    session.clear_reason();
    live_[session.name()] = session;
    announce();
  };
  CaptureOutcome outcome;
  nanoseconds lost_at{};
  while (true) {
    const int proven_before = session.proven_count();
    outcome = Capture(rig_, *calibrations_, data_ / "images", session, object_confirmed, report).run(stop);
    if (outcome.kind != Kind::kNodeLost) break;
    const nanoseconds now = monotonic_now();
    if (lost_at == nanoseconds(0) || session.proven_count() > proven_before) lost_at = now;
    if (now - lost_at > kNodeGrace) break;
    spdlog::warn("waiting for a node session={} reason=\"{}\"", session.name(), outcome.reason);
    {
      const std::lock_guard lock(mutex_);
      session.set_reason(fmt::format("waiting: {}", outcome.reason));
      live_[session.name()] = session;
      announce();
    }
    std::mutex waiting;
    std::unique_lock lock(waiting);
    std::condition_variable_any().wait_for(lock, stop, std::chrono::seconds(1), [] { return false; });
    if (stop.stop_requested()) {
      outcome = {Kind::kStopped, ""};
      break;
    }
  }
  const std::lock_guard lock(mutex_);
  const std::string go_on = fmt::format("; go on with: glasswing resume {}", session.name());
  session.clear_reason();
  switch (outcome.kind) {
    case Kind::kCaptured:
      session.set_state(v1::SESSION_STATE_CAPTURED);
      break;
    case Kind::kStopped:
      session.set_state(wish_ == Wish::kCancel ? v1::SESSION_STATE_CANCELLED : v1::SESSION_STATE_PAUSED);
      if (wish_ != Wish::kCancel)
        session.set_reason("asked to" + (outcome.reason.empty() ? "" : "; " + outcome.reason) + go_on);
      break;
    case Kind::kNodeLost:
      session.set_state(v1::SESSION_STATE_PAUSED);
      session.set_reason(outcome.reason + go_on);
      break;
    case Kind::kNeedsOperator:
      session.set_state(v1::SESSION_STATE_PAUSED);
      session.set_reason(outcome.reason);
      operator_asked_[session.name()] = outcome.reason.starts_with("place");
      break;
    case Kind::kFailed:
      session.set_state(v1::SESSION_STATE_FAILED);
      session.set_reason(outcome.reason);
      break;
  }
  const absl::Status written = change(session);
  if (!written.ok()) {
    // The catalogue still says "capturing"; say what is true until it can be written.
    session.set_state(v1::SESSION_STATE_PAUSED);
    session.set_reason(std::string(written.message()) + go_on);
    live_[session.name()] = session;
    announce();
  }
  spdlog::info("{} session={} proven={} of={} retaken={} reason=\"{}\"", state_of(session), session.name(),
               session.proven_count(), session.step_count(), session.retaken_count(), session.reason());
  capturing_.clear();
}

absl::StatusOr<v1::Session> Server::pause(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_PAUSED) return session;
  if (session.state() != v1::SESSION_STATE_CAPTURING) return not_now(session, "paused");
  {
    const std::lock_guard lock(mutex_);
    if (capturing_ == name) {
      wish_ = Wish::kPause;
      capture_thread_.request_stop();
    }
  }
  while (true) {
    const std::int64_t seen = wait_change(0, std::chrono::milliseconds(0));
    GW_ASSIGN_OR_RETURN(session, find(name));
    if (session.state() != v1::SESSION_STATE_CAPTURING) return session;
    wait_change(seen, std::chrono::seconds(1));
  }
}

absl::StatusOr<v1::Session> Server::resume(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURING) return session;
  const bool may = session.state() == v1::SESSION_STATE_PAUSED || session.state() == v1::SESSION_STATE_FAILED;
  if (!may || session.plan().method().empty()) return not_now(session, "resumed");
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(check_rig_is_free());
  if (session.tile_count() > 0) return not_now(session, "resumed; solve it again instead");
  start_capture(session);
  return live_.at(name);
}

absl::StatusOr<v1::Session> Server::cancel(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_CANCELLED) return session;
  if (session.state() == v1::SESSION_STATE_CAPTURING) {
    {
      const std::lock_guard lock(mutex_);
      if (capturing_ == name) {
        wish_ = Wish::kCancel;
        capture_thread_.request_stop();
      }
    }
    while (session.state() == v1::SESSION_STATE_CAPTURING) {
      const std::int64_t seen = wait_change(0, std::chrono::milliseconds(0));
      GW_ASSIGN_OR_RETURN(session, find(name));
      if (session.state() == v1::SESSION_STATE_CAPTURING) wait_change(seen, std::chrono::seconds(1));
    }
    return session;
  }
  const std::lock_guard lock(mutex_);
  if (session.state() == v1::SESSION_STATE_SOLVING) {
    // Its frames are all there: only the solve is given up.
    GW_RETURN_IF_ERROR(jobs_->give_up(name));
    session.set_state(v1::SESSION_STATE_CAPTURED);
    session.set_reason("the solve was cancelled");
  } else if (session.state() == v1::SESSION_STATE_PAUSED || session.state() == v1::SESSION_STATE_CREATED) {
    session.set_state(v1::SESSION_STATE_CANCELLED);
    session.clear_reason();
  } else {
    return not_now(session, "cancelled");
  }
  GW_RETURN_IF_ERROR(change(session));
  return session;
}

absl::StatusOr<v1::Session> Server::begin_import(const v1::BeginImportRequest& request) {
  GW_RETURN_IF_ERROR(check_name("session", request.name()));
  GW_ASSIGN_OR_RETURN(const v1::Node camera, rig_.camera());
  v1::Session session;
  session.set_name(request.name());
  session.set_created(utc_now_rfc3339());
  session.set_state(v1::SESSION_STATE_CREATED);
  session.set_reason("frames are being imported");
  session.set_archive_address(camera.address());
  const v1::Camera& shape = request.manifest().camera();
  session.set_pixel_count(static_cast<std::int64_t>(shape.width_px()) * shape.height_px());

  const NodeLink link(camera);
  v1::CreateArchiveRequest create;
  *create.mutable_manifest() = request.manifest();
  create.mutable_manifest()->set_session(request.name());
  create.mutable_manifest()->clear_frames();
  v1::CreateArchiveResponse created;
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<v1::Session> before = catalogue_->find(request.name());
    // An import that broke off may be taken up again; anything else keeps its name.
    const bool again = before.ok() && before->state() == v1::SESSION_STATE_CREATED && !before->has_plan();
    if (!again) GW_RETURN_IF_ERROR(catalogue_->insert(session, ""));
    announce();
  }
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  GW_RETURN_IF_ERROR(from_grpc(
      v1::ArchiveService::NewStub(link.channel())->CreateArchive(&context, create, &created), link.title()));
  return session;
}

absl::StatusOr<v1::Session> Server::finish_import(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURED) return session;
  if (session.state() != v1::SESSION_STATE_CREATED || session.has_plan()) return not_now(session, "imported");
  const std::unique_ptr<v1::ArchiveService::Stub> archive =
      v1::ArchiveService::NewStub(dial(session.archive_address()));
  const std::string peer = "camera node at " + session.archive_address();
  v1::SealArchiveRequest seal;
  seal.set_session(name);
  v1::SealArchiveResponse sealed;
  grpc::ClientContext seal_context;
  set_deadline(seal_context, std::chrono::seconds(30));
  GW_RETURN_IF_ERROR(from_grpc(archive->SealArchive(&seal_context, seal, &sealed), peer));
  v1::GetManifestRequest get;
  get.set_session(name);
  v1::GetManifestResponse manifest;
  grpc::ClientContext get_context;
  set_deadline(get_context, std::chrono::seconds(30));
  GW_RETURN_IF_ERROR(from_grpc(archive->GetManifest(&get_context, get, &manifest), peer));
  session.set_method(usual_method(manifest.manifest()));
  note_video(manifest.manifest(), session);
  session.set_step_count(manifest.manifest().frames_size());
  session.set_proven_count(manifest.manifest().frames_size());
  session.set_state(v1::SESSION_STATE_CAPTURED);
  session.clear_reason();
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(change(session));
  return session;
}

}  // namespace glasswing
