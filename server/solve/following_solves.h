// Solves sessions that are to be solved as soon as they are captured (Session.solve_follows).
#pragma once

#include <absl/status/status.h>

#include <span>
#include <stop_token>
#include <string>
#include <thread>

#include "server/sessions/session_store.h"
#include "server/solve/session_queue.h"
#include "server/solve/solve_runner.h"

namespace glasswing {

// Thread-safe.
class FollowingSolves {
 public:
  FollowingSolves(SessionStore& sessions, SolveRunner& solves);

  // The session may be captured: solves it if so, as soon as its archive and the job store answer.
  void look(const std::string& session) { to_look_at_.add(session); }
  // Those that an earlier server captured but did not solve.
  void take_up(std::span<const v1::Session> sessions);

 private:
  void run(std::stop_token stop);
  // UNAVAILABLE: try again.
  absl::Status solve(const std::string& name);

  SessionStore& sessions_;
  SolveRunner& solves_;
  SessionQueue to_look_at_;
  std::jthread thread_;  // last: uses all of the above
};

}  // namespace glasswing
