#include "server/capture/capture_runner.h"

#include <fmt/format.h>
#include <google/protobuf/util/message_differencer.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "core/process/pause.h"
#include "server/archives/session_archive.h"
#include "server/capture/capture_check.h"
#include "server/rig/stage_axes.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kNodeGrace(30);  // how long a capture waits for a lost node before it pauses
constexpr std::chrono::seconds kProgressSaved(2);  // how much of the catalogue a power cut may lose

std::string go_on(const v1::Session& session) {
  return fmt::format("; resume with: glasswing resume {}", session.name());
}

}  // namespace

CaptureRunner::~CaptureRunner() {
  {
    const std::lock_guard lock(mutex_);
    if (!capturing_.empty() && wish_ == Wish::kNone) wish_ = Wish::kPause;
    thread_.request_stop();
  }
  if (thread_.joinable()) thread_.join();
}

void CaptureRunner::take_up(SessionStore::Edit& edit, std::span<const v1::Session> sessions) {
  for (v1::Session session : sessions) {
    if (session.state() != v1::SESSION_STATE_CAPTURING) continue;
    session.set_state(v1::SESSION_STATE_PAUSED);
    session.set_reason("the server was restarted" + go_on(session));
    const absl::Status stored = edit.change(session);
    if (stored.ok()) continue;
    spdlog::error("not stored session={} error=\"{}\"", session.name(), std::string(stored.message()));
    edit.show(session);  // true until it can be written
  }
}

absl::Status CaptureRunner::check_new_name(const std::string& name) {
  GW_RETURN_IF_ERROR(check_name("session", name));
  if (absl::IsNotFound(sessions_.stored(name).status())) return absl::OkStatus();
  return absl::AlreadyExistsError(fmt::format("session \"{}\" already exists; choose another name", name));
}

absl::StatusOr<v1::EstimateSessionResponse> CaptureRunner::estimate(
    const v1::EstimateSessionRequest& request) {
  if (!request.name().empty()) GW_RETURN_IF_ERROR(check_new_name(request.name()));
  GW_ASSIGN_OR_RETURN(CheckedCapture checked, check_capture(nodes_, calibrations_, request.plan()));
  if (const auto holder = rig_lock_.holder()) *checked.estimate.mutable_holder() = *holder;
  return std::move(checked.estimate);
}

absl::Status CaptureRunner::check_images(const std::vector<Step>& steps) const {
  for (const Step& step : steps) {
    const std::string& image = step.stimulus.image();
    if (!image.empty() && !images_.has(image)) {
      return absl::InvalidArgumentError(
          fmt::format("photo \"{}\" has not been uploaded", step.stimulus.name()));
    }
  }
  return absl::OkStatus();
}

absl::Status CaptureRunner::check_pose(const v1::CreateSessionRequest& request) const {
  if (!request.axes().empty()) {
    GW_ASSIGN_OR_RETURN(const v1::Node node, nodes_.camera(request.plan().camera()));
    NodeLink camera(node);
    GW_RETURN_IF_ERROR(check_axes(camera, request.axes()));
  }
  if (request.empty_stage_of().empty()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const v1::Session before, sessions_.stored(request.empty_stage_of()));
  const bool captured = is_wholly_proven(before);
  v1::Plan plan = before.plan();
  plan.clear_rounds();
  if (captured && google::protobuf::util::MessageDifferencer::Equals(plan, request.plan()))
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the empty stage of session \"{}\" cannot be taken: {}", before.name(),
                  captured ? "it is of another plan" : "its capture is not complete"));
}

// "20261101-120000", with a number appended if that session exists.
std::string CaptureRunner::chosen_name(const std::string& created) {
  std::string stamp = created;
  std::erase_if(stamp, [](char c) { return c == '-' || c == ':' || c == 'Z'; });
  std::replace(stamp.begin(), stamp.end(), 'T', '-');
  std::string name = stamp;
  for (int i = 2; sessions_.stored(name).ok(); ++i) name = fmt::format("{}-{}", stamp, i);
  return name;
}

absl::StatusOr<v1::Session> CaptureRunner::create(const v1::CreateSessionRequest& request,
                                                  const Caller& caller) {
  const absl::StatusOr<v1::Session> before = sessions_.find_request(request.request_id());
  if (!absl::IsNotFound(before.status())) return before;
  if (request.solve() && request.plan().has_calibration()) {
    return absl::InvalidArgumentError(
        "the plan measures devices and holds no object; it can be captured, but not solved");
  }
  GW_ASSIGN_OR_RETURN(const CheckedCapture checked, check_capture(nodes_, calibrations_, request.plan()));
  v1::Session session;
  session.set_created(utc_now_rfc3339());
  session.set_started_by(caller.client);
  session.set_name(request.name().empty() ? chosen_name(session.created()) : request.name());
  GW_RETURN_IF_ERROR(check_new_name(session.name()));
  *session.mutable_plan() = request.plan();
  session.set_method(request.plan().method());
  session.set_solve_follows(request.solve() || request.plan().has_adapt());
  if (is_video(request.plan())) session.set_frame_count(ramp_frames_of(request.plan().ramp()));
  session.set_step_count(static_cast<int>(checked.steps.size()));
  GW_ASSIGN_OR_RETURN(*session.mutable_rail_mm(),
                      positions_of(checked.estimate.monitors(), request.rail_mm()));
  GW_RETURN_IF_ERROR(check_pose(request));
  *session.mutable_axes() = request.axes();
  session.set_empty_stage_of(request.empty_stage_of());
  const v1::Camera& camera = checked.estimate.camera();
  session.set_pixel_count(static_cast<std::int64_t>(camera.width_px()) * camera.height_px());
  session.set_state(v1::SESSION_STATE_CREATED);

  SessionStore::Edit edit = sessions_.edit();
  GW_RETURN_IF_ERROR(check_images(checked.steps));
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(session.name(), caller));
  GW_RETURN_IF_ERROR(edit.insert(session, request.request_id()));
  images_.use(photos_of(session));
  fault_point("session stored");
  return start(edit, std::move(session), std::move(drive));
}

absl::StatusOr<RigLock::Drive> CaptureRunner::drive_for(const std::string& session, const Caller& caller) {
  return rig_lock_.drive(caller, "session " + session, "glasswing cancel " + session);
}

v1::Session CaptureRunner::start(SessionStore::Edit& edit, v1::Session session, RigLock::Drive drive) {
  session.set_state(v1::SESSION_STATE_CAPTURING);
  session.clear_reason();
  session.clear_unproven();
  const std::lock_guard lock(mutex_);
  std::optional<bool> confirmed;
  if (const auto asked = operator_asked_.find(session.name()); asked != operator_asked_.end()) {
    confirmed = asked->second;
    operator_asked_.erase(asked);
  }
  // An error recurs, and is reported, when the capture's outcome is written.
  (void)edit.save_progress(session);
  capturing_ = session.name();
  drive_ = std::move(drive);
  wish_ = Wish::kNone;
  edit.show(session);
  spdlog::info("capturing session={} steps={}", session.name(), session.step_count());
  if (thread_.joinable()) thread_.join();  // has let go of the rig, so it needs no lock any more
  thread_ = std::jthread(
      [this, session, confirmed](std::stop_token stop) { capture_until_done(session, confirmed, stop); });
  return session;
}

void CaptureRunner::capture_until_done(v1::Session session, std::optional<bool> object_confirmed,
                                       std::stop_token stop) {
  using Kind = CaptureOutcome::Kind;
  nanoseconds saved_at = monotonic_now();
  const auto report = [this, &session, &saved_at](const v1::Session& progress) {
    SessionStore::Edit edit = sessions_.edit();
    if (!progress.reason().empty()) spdlog::warn("{} session={}", progress.reason(), session.name());
    session = progress;
    // First, so that a restarted server never shows fewer proven steps than were shown before.
    if (monotonic_now() - saved_at < kProgressSaved) {
      (void)edit.note_progress(session);
    } else {
      saved_at = monotonic_now();
      (void)edit.save_progress(session);
    }
    edit.show(as_it_ends(session));
    progressed_(session);
  };
  const auto next_round = [this](const v1::Session& captured,
                                 std::stop_token until) -> absl::StatusOr<v1::Session> {
    GW_ASSIGN_OR_RETURN(v1::Session grown, next_round_(captured, std::move(until)));
    // Before its first step is shown: a later choice must not give a different picture the same number.
    GW_RETURN_IF_ERROR(sessions_.edit().save_progress(grown));
    return grown;
  };
  CaptureOutcome outcome;
  nanoseconds lost_at{};
  while (true) {
    const int proven_before = session.proven_count();
    outcome = Capture(nodes_, calibrations_, images_, session, object_confirmed, steps_, report, next_round)
                  .run(stop);
    const bool no_room = outcome.kind == Kind::kNoRoom;
    if (outcome.kind != Kind::kNodeLost && !no_room) break;
    const nanoseconds now = monotonic_now();
    if (lost_at == nanoseconds(0) || session.proven_count() > proven_before || no_room) lost_at = now;
    if (now - lost_at > kNodeGrace) break;
    const std::string reason = fmt::format("{}: {}", no_room ? kWaitsForRoom : kWaitsForNode, outcome.reason);
    if (!session.reason().starts_with(kWaitsForNode)) spdlog::warn("{} session={}", reason, session.name());
    session.set_reason(reason);
    sessions_.edit().show(session);
    if (!pause(stop, std::chrono::seconds(1))) {
      outcome = {Kind::kStopped, ""};
      break;
    }
  }
  note_outcome(std::move(session), outcome);
}

v1::Session CaptureRunner::as_it_ends(v1::Session session) {
  const std::lock_guard lock(mutex_);
  if (capturing_ != session.name() || wish_ == Wish::kNone) return session;
  session.set_reason(std::string(wish_ == Wish::kCancel ? kCancelling : kPausing));
  return session;
}

void CaptureRunner::note_outcome(v1::Session session, const CaptureOutcome& outcome) {
  using Kind = CaptureOutcome::Kind;
  SessionStore::Edit edit = sessions_.edit();
  const std::lock_guard lock(mutex_);
  session.clear_reason();
  switch (outcome.kind) {
    case Kind::kCaptured:
      session.set_state(v1::SESSION_STATE_CAPTURED);
      break;
    case Kind::kStopped:
      session.set_state(wish_ == Wish::kCancel ? v1::SESSION_STATE_CANCELLED : v1::SESSION_STATE_PAUSED);
      if (wish_ != Wish::kCancel)
        session.set_reason(std::string(kPausedOnRequest) +
                           (outcome.reason.empty() ? "" : "; " + outcome.reason) + go_on(session));
      break;
    case Kind::kNodeLost:
      session.set_state(v1::SESSION_STATE_PAUSED);
      session.set_reason(outcome.reason + go_on(session));
      break;
    case Kind::kNeedsOperator:
      session.set_state(v1::SESSION_STATE_PAUSED);
      session.set_reason(outcome.reason);
      operator_asked_[session.name()] = outcome.reason.starts_with(kPlaceObject);
      break;
    case Kind::kFailed:
      session.set_state(v1::SESSION_STATE_FAILED);
      session.set_reason(outcome.reason);
      break;
    case Kind::kNoRoom:  // never the last outcome: the capture waits for room until it is stopped
      break;
  }
  const absl::Status written = edit.change(session);
  if (!written.ok()) {
    // The catalogue still says "capturing"; the live view is correct until it can be written.
    session.set_state(v1::SESSION_STATE_PAUSED);
    session.set_reason(std::string(written.message()) + go_on(session));
    edit.show(session);
  }
  spdlog::info("{} session={} proven={} of={} retaken={} reason=\"{}\"", state_of(session), session.name(),
               session.proven_count(), session.step_count(), session.retaken_count(), session.reason());
  progressed_(session);
  capturing_.clear();
  drive_.reset();
  if (outcome.kind == Kind::kCaptured) captured_(session.name());
}

absl::StatusOr<v1::Session> CaptureRunner::stop(const std::string& name, Wish wish, const Caller& caller) {
  GW_RETURN_IF_ERROR(rig_lock_.check(caller));
  {
    SessionStore::Edit edit = sessions_.edit();
    {
      const std::lock_guard lock(mutex_);
      if (capturing_ == name) {
        if (wish_ != Wish::kCancel) wish_ = wish;
        thread_.request_stop();
      }
    }
    GW_ASSIGN_OR_RETURN(const v1::Session session, edit.find(name));
    if (session.state() == v1::SESSION_STATE_CAPTURING) edit.show(as_it_ends(session));
  }
  while (true) {
    const std::int64_t seen = sessions_.wait_change(0, std::chrono::milliseconds(0));
    GW_ASSIGN_OR_RETURN(const v1::Session session, sessions_.find(name));
    if (session.state() != v1::SESSION_STATE_CAPTURING) return session;
    sessions_.wait_change(seen, std::chrono::seconds(1));
  }
}

absl::StatusOr<v1::Session> CaptureRunner::resume(SessionStore::Edit& edit, v1::Session session,
                                                  const v1::ResumeSessionRequest& request,
                                                  const Caller& caller) {
  if (request.has_retries()) session.mutable_plan()->set_retries(request.retries());
  GW_RETURN_IF_ERROR(check_plan(session.plan()));
  if (!request.retake().empty()) {
    *session.mutable_retaking() = request.retake();
    const std::lock_guard lock(mutex_);
    operator_asked_.erase(session.name());  // a retake does not say that the object was moved
  }
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(session.name(), caller));
  return start(edit, std::move(session), std::move(drive));
}

absl::StatusOr<v1::Session> CaptureRunner::cancel(SessionStore::Edit& edit, v1::Session session) {
  session.set_state(v1::SESSION_STATE_CANCELLED);
  session.clear_reason();
  GW_RETURN_IF_ERROR(edit.change(session));
  return session;
}

absl::StatusOr<std::vector<v1::StepEvent>> CaptureRunner::steps(const std::string& name, size_t first) {
  if (auto events = steps_.events(name, first)) return *std::move(events);
  GW_ASSIGN_OR_RETURN(const v1::Session session, sessions_.find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURING || session.archive_address().empty())
    return std::vector<v1::StepEvent>();
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  return proven_steps(manifest);
}

void CaptureRunner::forget(const v1::Session& session) {
  images_.release(photos_of(session), sessions_.photos());
  const std::lock_guard lock(mutex_);
  operator_asked_.erase(session.name());
}

}  // namespace glasswing
