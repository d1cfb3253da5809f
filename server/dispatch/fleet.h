// The solvers: what each one does and how fast, derived from their calls, the registered nodes and the job
// store.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "server/dispatch/minute_rate.h"
#include "server/jobs/job_store.h"
#include "server/rig/node_registry.h"

namespace glasswing {

// Thread-safe. A solver that is silent for ten minutes is forgotten. Invalid node names are ignored. Tiles
// that are done or failed are counted for monitoring too (server_metrics.h).
class Fleet {
 public:
  explicit Fleet(std::function<nanoseconds()> now = monotonic_now) : now_(std::move(now)) {}

  void refused(const std::string& solver, const std::string& why);  // until its next claim
  void claimed(const std::string& solver);                          // even if there was no tile
  void completed(const std::string& solver, double seconds);
  void spoiled(const std::string& solver);  // it handed in a matte that cannot be read
  int spoiled_by(const std::string& solver) const;
  void failed(const std::string& solver, const std::string& session, int tile, const std::string& error);

  // `solvers` have registered with this server. A solver that has not, for example one of another server that
  // shares the store, is up if it was heard from in the last ten seconds or has a lease.
  v1::GetFleetResponse describe(const std::vector<RegisteredSolver>& solvers,
                                const std::vector<JobState>& jobs, const std::vector<LeaseState>& leases,
                                const std::string& store) const;

 private:
  struct Solver {
    explicit Solver(nanoseconds now) : heard(now), rate(now) {}
    nanoseconds heard;
    MinuteRate rate;  // of tiles done
    std::string refused, last_error;
    std::int64_t done = 0, failed = 0;
    int spoiled = 0;
  };
  // Applies `change` to the solver's entry, which has just been heard from.
  void note(const std::string& name, const std::function<void(Solver&)>& change);

  const std::function<nanoseconds()> now_;
  mutable std::mutex mutex_;
  std::map<std::string, Solver> solvers_;  // by name; guarded by mutex_
  std::optional<nanoseconds> heard_;       // from any solver; guarded by mutex_
};

}  // namespace glasswing
