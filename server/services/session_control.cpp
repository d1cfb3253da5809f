#include "server/services/session_control.h"

#include <fmt/format.h>

#include <utility>

#include "core/base/status.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

bool is_capturing(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_CAPTURING;
}

}  // namespace

absl::StatusOr<v1::Session> SessionControl::pause(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find(name));
  if (is_capturing(session)) return captures_.stop(name, CaptureRunner::Wish::kPause, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find(name));
  if (is_already(session, v1::SESSION_ACTION_PAUSE)) return session;
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_PAUSE));
  if (is_capturing(session)) return not_now(session, "paused");  // began since; the client may ask again
  return solves_.pause(edit, std::move(session));
}

absl::StatusOr<v1::Session> SessionControl::resume(const v1::ResumeSessionRequest& request,
                                                   const Caller& caller) {
  if (!request.retake().empty()) return retake(request, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, edit.find(request.name()));
  if (is_already(session, v1::SESSION_ACTION_RESUME)) return session;
  GW_RETURN_IF_ERROR(edit.check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_RESUME));
  if (rests_in_solve(session)) return solves_.resume(edit, std::move(session));
  return captures_.resume(edit, std::move(session), request, caller);
}

absl::StatusOr<v1::Session> SessionControl::retake(const v1::ResumeSessionRequest& request,
                                                   const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find(request.name()));
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
  GW_ASSIGN_OR_RETURN(session, edit.find(request.name()));
  GW_RETURN_IF_ERROR(edit.check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_RETAKE));
  if (is_capturing(session)) return not_now(session, "retaken");  // began since; the client may ask again
  return captures_.resume(edit, std::move(session), request, caller);
}

absl::StatusOr<v1::Session> SessionControl::cancel(const std::string& name, const Caller& caller) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.find(name));
  if (is_capturing(session)) return captures_.stop(name, CaptureRunner::Wish::kCancel, caller);
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find(name));
  if (is_already(session, v1::SESSION_ACTION_CANCEL)) return session;
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_CANCEL));
  if (is_capturing(session)) return not_now(session, "cancelled");  // began since; the client may ask again
  if (session.state() == v1::SESSION_STATE_SOLVING || rests_in_solve(session))
    return solves_.cancel(edit, std::move(session), "the solve was cancelled");
  return captures_.cancel(edit, std::move(session));
}

}  // namespace glasswing
