#include "server/services/session_control.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "core/base/status.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

bool is_capturing(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_CAPTURING;
}

absl::Status check_stays(const SessionStore::Edit& edit, const std::string& name) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, edit.find_each(name));
  for (const v1::Session& one : each) GW_RETURN_IF_ERROR(edit.check_stays(one.name()));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Session> SessionControl::pause(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find_any(name));
  if (is_capturing(session)) return captures_.stop(name, CaptureRunner::Wish::kPause, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find_any(name));
  if (is_already(session, v1::SESSION_ACTION_PAUSE)) return session;
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_PAUSE));
  if (is_capturing(session)) return not_now(session, "paused");  // began since; the client may ask again
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, edit.find_each(name));
  for (const v1::Session& one : each) {
    if (allows(one, v1::SESSION_ACTION_PAUSE)) GW_RETURN_IF_ERROR(solves_.pause(edit, one).status());
  }
  return edit.find_any(name);
}

absl::StatusOr<v1::Session> SessionControl::resume(const v1::ResumeSessionRequest& request,
                                                   const Caller& caller) {
  if (!request.retake().empty()) return retake(request, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, edit.find_any(request.name()));
  if (is_already(session, v1::SESSION_ACTION_RESUME)) return session;
  GW_RETURN_IF_ERROR(check_stays(edit, request.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_RESUME));
  if (rests_in_solve(session)) return resume_solve(edit, session);
  return captures_.resume(edit, std::move(session), request, caller);
}

absl::StatusOr<v1::Session> SessionControl::resume_solve(SessionStore::Edit& edit,
                                                         const v1::Session& session) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, edit.find_each(session.name()));
  for (const v1::Session& one : each) {
    if (rests_in_solve(one)) GW_RETURN_IF_ERROR(solves_.resume(edit, one).status());
  }
  return edit.find_any(session.name());
}

absl::StatusOr<v1::Session> SessionControl::retake(const v1::ResumeSessionRequest& request,
                                                   const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find_any(request.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_RETAKE));
  for (const v1::StepRange& range : request.retake()) {
    if (range.first() >= 0 && range.first() <= range.last() && range.last() < session.step_count()) continue;
    return absl::InvalidArgumentError(fmt::format("steps {}-{} were requested; session \"{}\" has steps 0-{}",
                                                  range.first(), range.last(), session.name(),
                                                  session.step_count() - 1));
  }
  if (is_capturing(session))
    GW_RETURN_IF_ERROR(captures_.stop(session.name(), CaptureRunner::Wish::kPause, caller).status());
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find_any(request.name()));
  GW_RETURN_IF_ERROR(check_stays(edit, request.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_RETAKE));
  if (is_capturing(session)) return not_now(session, "retaken");  // began since; the client may ask again
  return captures_.resume(edit, std::move(session), request, caller);
}

absl::StatusOr<v1::Session> SessionControl::cancel(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find_any(name));
  if (is_capturing(session)) return captures_.stop(name, CaptureRunner::Wish::kCancel, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find_any(name));
  if (is_already(session, v1::SESSION_ACTION_CANCEL)) return session;
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_CANCEL));
  if (is_capturing(session)) return not_now(session, "cancelled");  // began since; the client may ask again
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, edit.find_each(name));
  for (const v1::Session& one : each) {
    if (!allows(one, v1::SESSION_ACTION_CANCEL)) continue;
    const bool solve = one.state() == v1::SESSION_STATE_SOLVING || rests_in_solve(one);
    GW_RETURN_IF_ERROR(
        (solve ? solves_.cancel(edit, one, "the solve was cancelled") : captures_.cancel(edit, one))
            .status());
  }
  return edit.find_any(name);
}

absl::StatusOr<v1::Session> SessionControl::solve(const v1::SolveSessionRequest& request) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, sessions_.find_any(request.name()));
  if (session.views().empty()) return solves_.solve(request);
  // All or none, as far as their states say.
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_SOLVE));
  for (const v1::Session& view : session.views()) {
    v1::SolveSessionRequest own = request;
    own.set_name(view.name());
    GW_RETURN_IF_ERROR(solves_.solve(own).status());
  }
  return sessions_.find_any(request.name());
}

}  // namespace glasswing
