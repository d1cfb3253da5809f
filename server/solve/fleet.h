// Who solves, what, and how fast: what solvers said to this server, with what the rig and the job store know
// of them.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "server/jobs/job_store.h"
#include "server/rig/node_registry.h"
#include "server/solve/minute_rate.h"

namespace glasswing {

// Thread-safe. A solver of which nothing was heard for ten minutes is forgotten; nothing is noted under what
// is no name of a node. What is done and failed is counted for monitoring too (server_metrics.h).
class Fleet {
 public:
  explicit Fleet(std::function<nanoseconds()> now = monotonic_now) : now_(std::move(now)) {}

  void refused(const std::string& solver, const std::string& why);  // until it claims
  void claimed(const std::string& solver);                          // whether there was a tile or not
  void completed(const std::string& solver, double seconds);
  void failed(const std::string& solver, const std::string& session, int tile, const std::string& error);

  // `solvers` have registered with this server; those that work for it without, as those of another server
  // that shares the store do, are up if something was heard of them in the last ten seconds or they hold a
  // lease.
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
  };
  // Does it with what is known of the solver, heard of now.
  void note(const std::string& name, const std::function<void(Solver&)>& change);

  const std::function<nanoseconds()> now_;
  mutable std::mutex mutex_;
  std::map<std::string, Solver> solvers_;  // by name; guarded by mutex_
};

}  // namespace glasswing
