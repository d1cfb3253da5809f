#include "server/sessions/session_state.h"

#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <algorithm>

#include "core/pattern/plan.h"

namespace glasswing {
namespace {

using Condition = bool (*)(const v1::Session&);

bool always(const v1::Session&) {
  return true;
}
// An imported session has no plan, and so nothing to capture.
bool captures_a_plan(const v1::Session& session) {
  return !rests_in_solve(session) && !session.plan().method().empty();
}
bool is_not_being_stopped(const v1::Session& session) {
  return session.reason() != kPausing && session.reason() != kCancelling;
}
bool is_not_being_cancelled(const v1::Session& session) {
  return session.reason() != kCancelling;
}
// A video runs once. A copy contains the old frames.
bool may_be_retaken(const v1::Session& session) {
  return captures_a_plan(session) && !is_video(session.plan()) && session.copies().empty();
}
// Only an import can be at rest in this state: a capture has a plan.
bool is_import(const v1::Session& session) {
  return !session.has_plan();
}
bool has_matte(const v1::Session& session) {
  return session.matte_ready() || !session.solved_frames().empty();
}
// The matte of an earlier solve is restored.
bool has_matte_to_return_to(const v1::Session& session) {
  return rests_in_solve(session) && session.matte_ready();
}
// A session that measured devices has no object.
bool holds_object(const v1::Session& session) {
  return !session.plan().has_calibration();
}
bool holds_object_and_rests_in_solve(const v1::Session& session) {
  return holds_object(session) && rests_in_solve(session);
}

struct Rule {
  v1::SessionState state;
  v1::SessionAction action;
  Condition condition = always;
};

constexpr Rule kRules[] = {
    {v1::SESSION_STATE_CREATED, v1::SESSION_ACTION_CANCEL},
    {v1::SESSION_STATE_CREATED, v1::SESSION_ACTION_DELETE, is_import},

    {v1::SESSION_STATE_CAPTURING, v1::SESSION_ACTION_PAUSE, is_not_being_stopped},
    {v1::SESSION_STATE_CAPTURING, v1::SESSION_ACTION_CANCEL, is_not_being_cancelled},
    {v1::SESSION_STATE_CAPTURING, v1::SESSION_ACTION_RETAKE,
     [](const v1::Session& session) { return may_be_retaken(session) && is_not_being_cancelled(session); }},

    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_RESUME, rests_in_solve},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_RESUME, captures_a_plan},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_CANCEL},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_SOLVE, holds_object_and_rests_in_solve},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_FETCH, has_matte},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_REPLICATE, rests_in_solve},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_DELETE},
    {v1::SESSION_STATE_PAUSED, v1::SESSION_ACTION_RETAKE, may_be_retaken},

    {v1::SESSION_STATE_CAPTURED, v1::SESSION_ACTION_SOLVE, holds_object},
    {v1::SESSION_STATE_CAPTURED, v1::SESSION_ACTION_REPLICATE},
    {v1::SESSION_STATE_CAPTURED, v1::SESSION_ACTION_DELETE},
    {v1::SESSION_STATE_CAPTURED, v1::SESSION_ACTION_RETAKE, may_be_retaken},

    {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_PAUSE},
    {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_CANCEL},
    {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_FETCH, has_matte},
    {v1::SESSION_STATE_SOLVING, v1::SESSION_ACTION_REPLICATE},

    {v1::SESSION_STATE_DONE, v1::SESSION_ACTION_SOLVE, holds_object},
    {v1::SESSION_STATE_DONE, v1::SESSION_ACTION_FETCH, has_matte},
    {v1::SESSION_STATE_DONE, v1::SESSION_ACTION_REPLICATE},
    {v1::SESSION_STATE_DONE, v1::SESSION_ACTION_DELETE},

    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_RETRY, rests_in_solve},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_RETRY, captures_a_plan},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_CANCEL, has_matte_to_return_to},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_SOLVE, holds_object_and_rests_in_solve},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_FETCH, has_matte},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_REPLICATE, rests_in_solve},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_DELETE},
    {v1::SESSION_STATE_FAILED, v1::SESSION_ACTION_RETAKE, may_be_retaken},

    {v1::SESSION_STATE_CANCELLED, v1::SESSION_ACTION_DELETE},
};

// No longer possible once the frames are removed.
bool needs_frames(v1::SessionAction action) {
  return action == v1::SESSION_ACTION_SOLVE || action == v1::SESSION_ACTION_REPLICATE ||
         action == v1::SESSION_ACTION_RETAKE || action == v1::SESSION_ACTION_RETRY;
}

// The states that an action leads to, in which repeating the request is not an error.
constexpr struct {
  v1::SessionAction action;
  v1::SessionState state;
} kReached[] = {
    {v1::SESSION_ACTION_PAUSE, v1::SESSION_STATE_PAUSED},
    {v1::SESSION_ACTION_RESUME, v1::SESSION_STATE_CAPTURING},
    {v1::SESSION_ACTION_RESUME, v1::SESSION_STATE_SOLVING},
    {v1::SESSION_ACTION_RETRY, v1::SESSION_STATE_CAPTURING},
    {v1::SESSION_ACTION_RETRY, v1::SESSION_STATE_SOLVING},
    {v1::SESSION_ACTION_CANCEL, v1::SESSION_STATE_CANCELLED},
};

absl::Status refusal(const v1::Session& session, v1::SessionAction action) {
  switch (action) {
    case v1::SESSION_ACTION_PAUSE:
      return not_now(session, "paused");
    case v1::SESSION_ACTION_RESUME:
    case v1::SESSION_ACTION_RETRY:
      return not_now(session, "resumed");
    case v1::SESSION_ACTION_CANCEL:
      return not_now(session, "cancelled");
    case v1::SESSION_ACTION_SOLVE:
      return not_now(session, "solved (it must be captured first)");
    case v1::SESSION_ACTION_FETCH:
      return not_now(session, "fetched (it must be solved first)");
    case v1::SESSION_ACTION_RETAKE:
      return not_now(session,
                     "retaken (only a capture that is neither solved, copied, imported nor a video can)");
    case v1::SESSION_ACTION_REPLICATE:
      return not_now(session, "replicated (it must be captured first)");
    default:
      return absl::FailedPreconditionError(
          fmt::format("session \"{}\" is {}; wait for it, or cancel it first: glasswing cancel {}",
                      session.name(), state_of(session), session.name()));
  }
}

}  // namespace

std::string state_of(const v1::Session& session) {
  return absl::AsciiStrToLower(
      v1::SessionState_Name(session.state()).substr(std::string("SESSION_STATE_").size()));
}

bool rests_in_solve(const v1::Session& session) {
  const bool rests =
      session.state() == v1::SESSION_STATE_PAUSED || session.state() == v1::SESSION_STATE_FAILED;
  return rests && session.job() != 0;
}

bool waits_for_person(const v1::Session& session) {
  const std::string& reason = session.reason();
  return session.state() == v1::SESSION_STATE_PAUSED &&
         (reason.starts_with(kPausedOnRequest) || reason.starts_with(kPlaceObject) ||
          reason.starts_with(kTakeObject));
}

std::vector<v1::SessionAction> allowed_actions(const v1::Session& session) {
  std::vector<v1::SessionAction> actions;
  if (!session.views().empty()) {  // their sum
    for (const int action : session.allowed_actions())
      actions.push_back(static_cast<v1::SessionAction>(action));
    return actions;
  }
  for (const Rule& rule : kRules) {
    if (!session.frames_gone().empty() && needs_frames(rule.action)) continue;
    if (rule.state == session.state() && rule.condition(session)) actions.push_back(rule.action);
  }
  return actions;
}

bool allows(const v1::Session& session, v1::SessionAction action) {
  return std::ranges::count(allowed_actions(session), action) > 0;
}

bool is_wholly_proven(const v1::Session& session) {
  return session.step_count() > 0 && session.proven_count() == session.step_count();
}

bool is_already(const v1::Session& session, v1::SessionAction action) {
  return std::ranges::any_of(
      kReached, [&](const auto& row) { return row.action == action && row.state == session.state(); });
}

absl::Status check_allows(const v1::Session& session, v1::SessionAction action) {
  if (allows(session, action)) return absl::OkStatus();
  if (action == v1::SESSION_ACTION_RESUME && allows(session, v1::SESSION_ACTION_RETRY))
    return absl::OkStatus();
  if (!session.frames_gone().empty() && needs_frames(action)) {
    return absl::FailedPreconditionError(fmt::format("session \"{}\" has no frames: they were removed at {}",
                                                     session.name(), session.frames_gone()));
  }
  return refusal(session, action);
}

absl::Status not_now(const v1::Session& session, const std::string& verb) {
  return absl::FailedPreconditionError(
      fmt::format("session \"{}\" is {}; it cannot be {}", session.name(), state_of(session), verb));
}

v1::Session with_allowed_actions(v1::Session session) {
  const std::vector<v1::SessionAction> actions = allowed_actions(session);
  session.clear_allowed_actions();
  for (const v1::SessionAction action : actions) session.add_allowed_actions(action);
  return session;
}

}  // namespace glasswing
