// Counts the tiles of a solve as results come in. A large job takes some time to count, so results that
// arrive together share one count.
#pragma once

#include <absl/status/status.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/solve/matte_assembly.h"
#include "server/solve/single_flight.h"
#include "server/solve/solve_clock.h"
#include "server/solve/solve_session.h"

namespace glasswing {

// Thread-safe.
class SolveProgress {
 public:
  SolveProgress(const SolveStores& stores, SolveClock& clock, MatteAssembly& assembly)
      : stores_(stores), clock_(clock), assembly_(assembly) {}

  // Shows the progress of the lease's solve, and finishes it once no tile is left. Call without an Edit.
  void update(const v1::TileLease& lease);
  // The session's last tile may be done although it cannot be counted now.
  void look_later(const std::string& session) { assembly_.look(session); }
  void forget(const std::string& session);

 private:
  absl::Status count(const v1::TileLease& lease);

  const SolveStores stores_;
  SolveClock& clock_;
  MatteAssembly& assembly_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<SingleFlight>> counting_;  // by session; guarded by mutex_
};

}  // namespace glasswing
