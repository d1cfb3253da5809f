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
#include "server/rig/stage_axes.h"
#include "server/sessions/session_state.h"
#include "server/sessions/views.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kNodeGrace(30);  // how long a capture waits for a lost node before it pauses
constexpr std::chrono::seconds kProgressSaved(2);  // how much of the catalogue a power cut may lose

std::string go_on(const v1::Session& session) {
  return fmt::format("; resume with: glasswing resume {}", capture_name(session));
}

bool waits(const CaptureOutcome& outcome) {
  return outcome.kind == CaptureOutcome::Kind::kNodeLost || outcome.kind == CaptureOutcome::Kind::kNoRoom;
}

std::int64_t proven_of(const std::vector<v1::Session>& sessions) {
  std::int64_t count = 0;
  for (const v1::Session& session : sessions) count += session.proven_count();
  return count;
}

// One that has left an adaptive capture, or was not stored yet when the server ended, lacks rounds that the
// others have. FAILED_PRECONDITION: it went on alone, and has others.
absl::Status share_rounds(std::vector<v1::Session>& views) {
  if (views.size() < 2) return absl::OkStatus();
  const v1::Session ahead =
      *std::ranges::max_element(views, {}, [](const v1::Session& view) { return view.plan().rounds_size(); });
  for (v1::Session& view : views) {
    for (int i = 0; i < view.plan().rounds_size(); ++i) {
      if (google::protobuf::util::MessageDifferencer::Equals(view.plan().rounds(i), ahead.plan().rounds(i)))
        continue;
      return absl::FailedPreconditionError(
          fmt::format("sessions \"{}\" and \"{}\" have chosen different images, and can therefore not be "
                      "captured together: finish each by its own name",
                      ahead.name(), view.name()));
    }
    *view.mutable_plan()->mutable_rounds() = ahead.plan().rounds();
  }
  return absl::OkStatus();
}

v1::SessionAction resumed_by(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_FAILED ? v1::SESSION_ACTION_RETRY : v1::SESSION_ACTION_RESUME;
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
  return sessions_.check_free(name);
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

absl::Status CaptureRunner::check_pose(const std::vector<v1::Session>& sessions) const {
  absl::Status reached;  // by a camera node's stage
  for (const v1::Session& session : sessions) {
    if (session.axes().empty()) break;
    GW_ASSIGN_OR_RETURN(const v1::Node node, nodes_.camera(session.plan().camera()));
    NodeLink camera(node);
    reached = check_axes(camera, session.axes());
    if (reached.ok()) break;
  }
  GW_RETURN_IF_ERROR(reached);
  for (const v1::Session& session : sessions) {
    if (session.empty_stage_of().empty()) continue;
    GW_ASSIGN_OR_RETURN(const v1::Session before, sessions_.stored(session.empty_stage_of()));
    const bool captured = is_wholly_proven(before);
    v1::Plan plan = before.plan();
    plan.clear_rounds();
    if (captured && google::protobuf::util::MessageDifferencer::Equals(plan, session.plan())) continue;
    return absl::InvalidArgumentError(
        fmt::format("the empty stage of session \"{}\" cannot be taken: {}", before.name(),
                    captured ? "it is of another plan" : "its capture is not complete"));
  }
  return absl::OkStatus();
}

// "20261101-120000", with a number appended if that session exists.
std::string CaptureRunner::chosen_name(const std::string& created) {
  std::string stamp = created;
  std::erase_if(stamp, [](char c) { return c == '-' || c == ':' || c == 'Z'; });
  std::replace(stamp.begin(), stamp.end(), 'T', '-');
  std::string name = stamp;
  for (int i = 2; !sessions_.check_free(name).ok(); ++i) name = fmt::format("{}-{}", stamp, i);
  return name;
}

absl::StatusOr<std::vector<v1::Session>> CaptureRunner::sessions_of(const v1::CreateSessionRequest& request,
                                                                    const CheckedCapture& checked,
                                                                    const Caller& caller) {
  v1::Session session;
  session.set_created(utc_now_rfc3339());
  session.set_started_by(caller.client);
  session.set_name(request.name().empty() ? chosen_name(session.created()) : request.name());
  GW_RETURN_IF_ERROR(check_new_name(session.name()));
  session.set_method(request.plan().method());
  session.set_solve_follows(request.solve() || request.plan().has_adapt());
  if (!request.plan().adapt().footprints().empty())
    session.mutable_options()->insert({"footprints", request.plan().adapt().footprints()});
  if (is_video(request.plan())) session.set_frame_count(ramp_frames_of(request.plan().ramp()));
  session.set_step_count(static_cast<int>(checked.steps.size()));
  GW_ASSIGN_OR_RETURN(*session.mutable_rail_mm(),
                      positions_of(checked.estimate.monitors(), request.rail_mm()));
  *session.mutable_axes() = request.axes();
  session.set_empty_stage_of(request.empty_stage_of());
  session.set_state(v1::SESSION_STATE_CREATED);
  std::vector<v1::Session> sessions;
  const std::vector<v1::Plan> plans = view_plans(request.plan());
  for (int i = 0; i < std::ssize(plans); ++i) {
    v1::Session& made = sessions.emplace_back(session);
    *made.mutable_plan() = plans[i];
    const bool is_view = plans.size() > 1;
    const v1::Camera& camera = is_view ? checked.estimate.cameras(i) : checked.estimate.camera();
    made.set_pixel_count(static_cast<std::int64_t>(camera.width_px()) * camera.height_px());
    if (!is_view) continue;
    made.set_view_of(session.name());
    made.set_view_camera(plans[i].camera());
    made.set_name(view_name(session.name(), plans[i].camera()));
    if (!session.empty_stage_of().empty())
      made.set_empty_stage_of(view_name(session.empty_stage_of(), plans[i].camera()));
    GW_RETURN_IF_ERROR(check_new_name(made.name()));
  }
  return sessions;
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
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> sessions, sessions_of(request, checked, caller));
  GW_RETURN_IF_ERROR(check_pose(sessions));
  const std::string name = capture_name(sessions.front());

  SessionStore::Edit edit = sessions_.edit();
  GW_RETURN_IF_ERROR(check_images(checked.steps));
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(name, caller));
  GW_RETURN_IF_ERROR(edit.insert(sessions, request.request_id()));
  images_.use(photos_of(sessions.front()));
  fault_point("session stored");
  start(edit, name, std::move(sessions), std::move(drive));
  return edit.find_any(name);
}

absl::StatusOr<RigLock::Drive> CaptureRunner::drive_for(const std::string& session, const Caller& caller) {
  return rig_lock_.drive(caller, "session " + session, "glasswing cancel " + session);
}

void CaptureRunner::start(SessionStore::Edit& edit, const std::string& name,
                          std::vector<v1::Session> sessions, RigLock::Drive drive) {
  const std::lock_guard lock(mutex_);
  std::optional<bool> confirmed;
  if (const auto asked = operator_asked_.find(name); asked != operator_asked_.end()) {
    confirmed = asked->second;
    operator_asked_.erase(asked);
  }
  capturing_ = name;
  views_.clear();
  drive_ = std::move(drive);
  wish_ = Wish::kNone;
  for (v1::Session& session : sessions) {
    session.set_state(v1::SESSION_STATE_CAPTURING);
    session.clear_reason();
    session.clear_unproven();
    // An error recurs, and is reported, when the capture's outcome is written.
    (void)edit.save_progress(session);
    views_.insert(session.name());
    edit.show(session);
    spdlog::info("capturing session={} steps={}", session.name(), session.step_count());
  }
  if (thread_.joinable()) thread_.join();  // has let go of the rig, so it needs no lock any more
  thread_ = std::jthread([this, name, sessions = std::move(sessions), confirmed](std::stop_token stop) {
    capture_until_done(name, sessions, confirmed, stop);
  });
}

void CaptureRunner::note_progress(const v1::Session& progress, v1::Session& session, nanoseconds& saved_at) {
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
}

void CaptureRunner::capture_until_done(const std::string& name, std::vector<v1::Session> sessions,
                                       std::optional<bool> object_confirmed, std::stop_token stop) {
  using Kind = CaptureOutcome::Kind;
  std::vector<nanoseconds> saved_at(sessions.size(), monotonic_now());
  const auto report = [&](const v1::Session& progress) {
    const auto i = std::ranges::find(sessions, progress.name(), &v1::Session::name) - sessions.begin();
    note_progress(progress, sessions[i], saved_at[i]);
  };
  const auto next_round = [this](std::vector<v1::Session> captured,
                                 std::stop_token until) -> absl::StatusOr<std::vector<v1::Session>> {
    GW_ASSIGN_OR_RETURN(std::vector<v1::Session> grown, next_round_(std::move(captured), std::move(until)));
    // Before its first step is shown: a later choice must not give a different picture the same number.
    for (const v1::Session& session : grown) GW_RETURN_IF_ERROR(sessions_.edit().save_progress(session));
    return grown;
  };
  std::vector<CaptureOutcome> outcomes(sessions.size(), {Kind::kNodeLost, ""});
  nanoseconds lost_at{};
  while (true) {
    const std::int64_t proven_before = proven_of(sessions);
    std::vector<v1::Session> left;  // a camera that has failed leaves the others
    for (int i = 0; i < std::ssize(sessions); ++i) {
      if (waits(outcomes[i])) left.push_back(sessions[i]);
    }
    const std::vector<CaptureOutcome> ended =
        Capture(nodes_, calibrations_, images_, name, left, object_confirmed, steps_, report, next_round)
            .run(stop);
    for (int i = 0, k = 0; i < std::ssize(sessions); ++i) {
      if (waits(outcomes[i])) outcomes[i] = ended[k++];
    }
    const auto waiting = std::ranges::find_if(outcomes, waits);
    if (waiting == outcomes.end()) break;
    const bool no_room = waiting->kind == Kind::kNoRoom;
    const nanoseconds now = monotonic_now();
    if (lost_at == nanoseconds(0) || proven_of(sessions) > proven_before || no_room) lost_at = now;
    if (now - lost_at > kNodeGrace) break;
    const std::string reason =
        fmt::format("{}: {}", no_room ? kWaitsForRoom : kWaitsForNode, waiting->reason);
    for (int i = 0; i < std::ssize(sessions); ++i) {
      if (waits(outcomes[i])) say_waiting(reason, sessions[i]);
    }
    if (!pause(stop, std::chrono::seconds(1))) {
      std::ranges::replace_if(outcomes, waits, CaptureOutcome{Kind::kStopped, ""});
      break;
    }
  }
  note_outcomes(std::move(sessions), outcomes);
}

void CaptureRunner::say_waiting(const std::string& reason, v1::Session& session) {
  if (!session.reason().starts_with(kWaitsForNode)) spdlog::warn("{} session={}", reason, session.name());
  session.set_reason(reason);
  sessions_.edit().show(session);
}

v1::Session CaptureRunner::as_it_ends(v1::Session session) {
  const std::lock_guard lock(mutex_);
  if (!views_.contains(session.name()) || wish_ == Wish::kNone) return session;
  session.set_reason(std::string(wish_ == Wish::kCancel ? kCancelling : kPausing));
  return session;
}

void CaptureRunner::note_outcomes(std::vector<v1::Session> sessions,
                                  const std::vector<CaptureOutcome>& outcomes) {
  SessionStore::Edit edit = sessions_.edit();
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < std::ssize(sessions); ++i) note_outcome(edit, std::move(sessions[i]), outcomes[i]);
  capturing_.clear();
  views_.clear();
  drive_.reset();
}

void CaptureRunner::note_outcome(SessionStore::Edit& edit, v1::Session session,
                                 const CaptureOutcome& outcome) {
  using Kind = CaptureOutcome::Kind;
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
      operator_asked_[capturing_] = outcome.reason.starts_with(kPlaceObject);
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
  if (outcome.kind == Kind::kCaptured) captured_(session.name());
}

absl::StatusOr<v1::Session> CaptureRunner::stop(const std::string& name, Wish wish, const Caller& caller) {
  GW_RETURN_IF_ERROR(rig_lock_.check(caller));
  {
    SessionStore::Edit edit = sessions_.edit();
    {
      const std::lock_guard lock(mutex_);
      if (capturing_ != name && views_.contains(name)) {
        return absl::FailedPreconditionError(fmt::format(
            "session \"{0}\" is being captured with the other cameras of \"{1}\"; name session \"{1}\"", name,
            capturing_));
      }
      if (capturing_ == name) {
        if (wish_ != Wish::kCancel) wish_ = wish;
        thread_.request_stop();
      }
    }
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, edit.find_each(name));
    for (const v1::Session& session : sessions) {
      if (session.state() == v1::SESSION_STATE_CAPTURING) edit.show(as_it_ends(session));
    }
  }
  while (true) {
    const std::int64_t seen = sessions_.wait_change(0, std::chrono::milliseconds(0));
    GW_ASSIGN_OR_RETURN(const v1::Session session, sessions_.find_any(name));
    if (session.state() != v1::SESSION_STATE_CAPTURING) return session;
    sessions_.wait_change(seen, std::chrono::seconds(1));
  }
}

absl::StatusOr<v1::Session> CaptureRunner::resume(SessionStore::Edit& edit, v1::Session session,
                                                  const v1::ResumeSessionRequest& request,
                                                  const Caller& caller) {
  const std::string& name = session.name();
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> sessions, edit.find_each(name));
  const bool retakes = !request.retake().empty();
  if (!session.views().empty()) {
    std::erase_if(sessions, [&](const v1::Session& view) {
      return rests_in_solve(view) || !allows(view, retakes ? v1::SESSION_ACTION_RETAKE : resumed_by(view));
    });
  }
  GW_RETURN_IF_ERROR(share_rounds(sessions));
  for (v1::Session& each : sessions) {
    if (request.has_retries()) each.mutable_plan()->set_retries(request.retries());
    GW_RETURN_IF_ERROR(check_plan(each.plan()));
    if (retakes) *each.mutable_retaking() = request.retake();
  }
  if (retakes) {
    const std::lock_guard lock(mutex_);
    operator_asked_.erase(name);  // a retake does not say that the object was moved
  }
  GW_ASSIGN_OR_RETURN(RigLock::Drive drive, drive_for(name, caller));
  start(edit, name, std::move(sessions), std::move(drive));
  return edit.find_any(name);
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
  operator_asked_.erase(session.view_of());
}

}  // namespace glasswing
