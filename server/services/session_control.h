// Pauses, resumes, cancels and solves sessions: consults the state table, then CaptureRunner or SolveRunner.
// Of a session with views (server/sessions/views) it does so with each view that allows it.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/capture/capture_runner.h"
#include "server/sessions/session_store.h"
#include "server/solve/solve_runner.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto.
class SessionControl {
 public:
  SessionControl(SessionStore& sessions, CaptureRunner& captures, SolveRunner& solves)
      : sessions_(sessions), captures_(captures), solves_(solves) {}

  absl::StatusOr<v1::Session> pause(const std::string& name, const Caller& caller);
  absl::StatusOr<v1::Session> resume(const v1::ResumeSessionRequest& request, const Caller& caller);
  absl::StatusOr<v1::Session> cancel(const std::string& name, const Caller& caller);
  absl::StatusOr<v1::Session> solve(const v1::SolveSessionRequest& request);

 private:
  absl::StatusOr<v1::Session> resume_solve(SessionStore::Edit& edit, const v1::Session& session);
  absl::StatusOr<v1::Session> retake(const v1::ResumeSessionRequest& request, const Caller& caller);

  SessionStore& sessions_;
  CaptureRunner& captures_;
  SolveRunner& solves_;
};

}  // namespace glasswing
