// The server's captures: which session drives the rig, and what becomes of it.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/fault_point.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "server/capture/capture_check.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kNodeGrace(30);    // how long a capture waits for a lost node before it pauses
constexpr std::chrono::seconds kProgressKept(2);  // as old the catalogue's word of a capture may be

}  // namespace

absl::Status Server::check_new_name(const std::string& name) {
  GW_RETURN_IF_ERROR(check_name("session", name));
  if (absl::IsNotFound(catalogue_->find(name).status())) return absl::OkStatus();
  return absl::AlreadyExistsError(
      fmt::format("there is a session \"{}\" already; choose another name", name));
}

absl::StatusOr<v1::EstimateSessionResponse> Server::estimate(const v1::EstimateSessionRequest& request) {
  if (!request.name().empty()) GW_RETURN_IF_ERROR(check_new_name(request.name()));
  GW_ASSIGN_OR_RETURN(CheckedCapture checked, check_capture(rig_, *calibrations_, request.plan()));
  if (const auto holder = rig_lock_.holder()) *checked.estimate.mutable_holder() = *holder;
  return std::move(checked.estimate);
}

absl::StatusOr<v1::Session> Server::create(const v1::CreateSessionRequest& request, const Caller& caller) {
  const absl::StatusOr<v1::Session> before = catalogue_->find_request(request.request_id());
  if (!absl::IsNotFound(before.status())) return before;
  GW_ASSIGN_OR_RETURN(const CheckedCapture checked, check_capture(rig_, *calibrations_, request.plan()));
  for (const Step& step : checked.steps) {
    const std::string& image = step.stimulus.image();
    if (!image.empty() && (!check_name("image", image).ok() || !fs::exists(data_ / "images" / image))) {
      return absl::InvalidArgumentError(
          fmt::format("photo \"{}\" has not been uploaded", step.stimulus.name()));
    }
  }
  v1::Session session;
  session.set_name(request.name());
  session.set_created(utc_now_rfc3339());
  session.set_started_by(caller.client);
  if (session.name().empty()) {
    std::string stamp = session.created();
    std::erase_if(stamp, [](char c) { return c == '-' || c == ':' || c == 'Z'; });
    std::replace(stamp.begin(), stamp.end(), 'T', '-');
    session.set_name(stamp);
    for (int i = 2; catalogue_->find(session.name()).ok(); ++i)
      session.set_name(fmt::format("{}-{}", stamp, i));
  }
  GW_RETURN_IF_ERROR(check_new_name(session.name()));
  *session.mutable_plan() = request.plan();
  session.set_method(request.plan().method());
  if (is_video(request.plan())) session.set_frame_count(ramp_frames_of(request.plan().ramp()));
  session.set_step_count(static_cast<int>(checked.steps.size()));
  const v1::Camera& camera = checked.estimate.camera();
  session.set_pixel_count(static_cast<std::int64_t>(camera.width_px()) * camera.height_px());
  session.set_state(v1::SESSION_STATE_CREATED);

  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(session.name(), caller));
  GW_RETURN_IF_ERROR(catalogue_->insert(session, request.request_id()));
  fault_point("session stored");
  start_capture(session, std::move(drive));
  return live_.at(session.name());
}

absl::StatusOr<RigLock::Drive> Server::drive_for(const std::string& session, const Caller& caller) {
  return rig_lock_.drive(caller, "session " + session, "glasswing cancel " + session);
}

void Server::start_capture(const v1::Session& created, RigLock::Drive drive) {
  v1::Session session = created;
  session.set_state(v1::SESSION_STATE_CAPTURING);
  session.clear_reason();
  session.clear_unproven();
  std::optional<bool> confirmed;
  if (const auto asked = operator_asked_.find(session.name()); asked != operator_asked_.end()) {
    confirmed = asked->second;
    operator_asked_.erase(asked);
  }
  // An error here is met again, and told, when the capture's end is written.
  (void)catalogue_->update(session);
  live_[session.name()] = session;
  capturing_ = session.name();
  drive_ = std::move(drive);
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
  nanoseconds kept_at = monotonic_now();
  const auto report = [this, &session, &kept_at](const v1::Session& progress) {
    const std::lock_guard lock(mutex_);
    session = progress;
    session.clear_reason();
    live_[session.name()] = session;
    announce();
    if (monotonic_now() - kept_at < kProgressKept) return;
    kept_at = monotonic_now();
    (void)catalogue_->update(session);  // so that a restart shows how far it came
  };
  CaptureOutcome outcome;
  nanoseconds lost_at{};
  while (true) {
    const int proven_before = session.proven_count();
    outcome =
        Capture(rig_, *calibrations_, data_ / "images", session, object_confirmed, steps_, report).run(stop);
    const bool no_room = outcome.kind == Kind::kNoRoom;
    if (outcome.kind != Kind::kNodeLost && !no_room) break;
    const nanoseconds now = monotonic_now();
    if (lost_at == nanoseconds(0) || session.proven_count() > proven_before || no_room) lost_at = now;
    if (now - lost_at > kNodeGrace) break;
    const std::string reason = fmt::format("waiting{}: {}", no_room ? " for room" : "", outcome.reason);
    if (!session.reason().starts_with("waiting")) spdlog::warn("{} session={}", reason, session.name());
    {
      const std::lock_guard lock(mutex_);
      session.set_reason(reason);
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
  note_outcome(std::move(session), outcome);
}

void Server::note_outcome(v1::Session session, const CaptureOutcome& outcome) {
  using Kind = CaptureOutcome::Kind;
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
    case Kind::kNoRoom:  // it waits until there is some, or somebody stops it
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
  drive_.reset();
}

absl::StatusOr<v1::Session> Server::end_capture(const std::string& name, Wish wish) {
  {
    const std::lock_guard lock(mutex_);
    if (capturing_ == name) {
      wish_ = wish;
      capture_thread_.request_stop();
    }
  }
  while (true) {
    const std::int64_t seen = wait_change(0, std::chrono::milliseconds(0));
    GW_ASSIGN_OR_RETURN(const v1::Session session, find(name));
    if (session.state() != v1::SESSION_STATE_CAPTURING) return session;
    wait_change(seen, std::chrono::seconds(1));
  }
}

absl::StatusOr<v1::Session> Server::pause(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURING) {
    GW_RETURN_IF_ERROR(rig_lock_.check(caller));
    return end_capture(name, Wish::kPause);
  }
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(session, find_locked(name));
  if (session.state() == v1::SESSION_STATE_PAUSED) return session;
  if (session.state() == v1::SESSION_STATE_SOLVING) return pause_solve(std::move(session));
  return not_now(session, "paused");
}

absl::StatusOr<v1::Session> Server::resume(const v1::ResumeSessionRequest& request, const Caller& caller) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::Session session, find_locked(request.name()));
  if (session.state() == v1::SESSION_STATE_CAPTURING || session.state() == v1::SESSION_STATE_SOLVING)
    return session;
  GW_RETURN_IF_ERROR(check_stays(session.name()));
  if (rests_in_solve(session)) return resume_solve(std::move(session));
  const bool may = session.state() == v1::SESSION_STATE_PAUSED || session.state() == v1::SESSION_STATE_FAILED;
  if (!may || session.plan().method().empty()) return not_now(session, "resumed");
  if (request.has_retries()) session.mutable_plan()->set_retries(request.retries());
  GW_RETURN_IF_ERROR(check_plan(session.plan()));
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(session.name(), caller));
  start_capture(session, std::move(drive));
  return live_.at(session.name());
}

absl::StatusOr<v1::Session> Server::cancel(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURING) {
    GW_RETURN_IF_ERROR(rig_lock_.check(caller));
    return end_capture(name, Wish::kCancel);
  }
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(session, find_locked(name));
  if (session.state() == v1::SESSION_STATE_CANCELLED) return session;
  // Of a solve that failed there is nothing to cancel unless an earlier matte comes back.
  const bool has_solve =
      session.state() == v1::SESSION_STATE_SOLVING ||
      (rests_in_solve(session) && (session.state() == v1::SESSION_STATE_PAUSED || session.matte_ready()));
  if (has_solve) return cancel_solve(std::move(session), "the solve was cancelled");
  if (session.state() != v1::SESSION_STATE_PAUSED && session.state() != v1::SESSION_STATE_CREATED)
    return not_now(session, "cancelled");
  session.set_state(v1::SESSION_STATE_CANCELLED);
  session.clear_reason();
  GW_RETURN_IF_ERROR(change(session));
  return session;
}

}  // namespace glasswing
