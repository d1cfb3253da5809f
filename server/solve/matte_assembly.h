// Finishes solves: joins the tiles into a matte that can be fetched, or reports why there is none. That takes
// seconds, so it has its own thread, and claims and results continue meanwhile.
#pragma once

#include <absl/status/status.h>

#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/sessions/matte_quality.h"
#include "server/solve/session_queue.h"
#include "server/solve/solve_clock.h"
#include "server/solve/solve_session.h"

namespace glasswing {

// Thread-safe.
class MatteAssembly {
 public:
  MatteAssembly(const SolveStores& stores, SolveClock& clock);

  // The session's tiles may all be done or quarantined: checks as soon as the job store answers.
  void look(const std::string& session) { to_look_at_.add(session); }

 private:
  void run(std::stop_token stop);
  // Also OK if tiles are still awaited. UNAVAILABLE: the job store does not answer; try again.
  absl::Status finish(const std::string& name);
  // Joins a session's tiles, which are all done, and records the warnings of their mattes and the quality.
  // FAILED_PRECONDITION: some of its frames were rejected.
  absl::Status assemble(const v1::Session& session, std::vector<std::string>& warnings,
                        std::optional<MatteQuality>& quality);
  absl::Status note_warnings_of_frames(v1::Session session, std::vector<std::string>& warnings) const;
  // The job store, for which the session waited, answers.
  void answers_again(const std::string& name);
  absl::Status settle(SessionStore::Edit& edit, v1::Session session, const absl::Status& made);

  const SolveStores stores_;
  SolveClock& clock_;
  SessionQueue to_look_at_;
  std::jthread thread_;  // last: uses all of the above
};

}  // namespace glasswing
