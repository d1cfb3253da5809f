#include "server/dispatch/fleet.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <span>

#include "core/base/name.h"
#include "core/base/time.h"
#include "server/metrics/server_metrics.h"

namespace glasswing {
namespace {

constexpr nanoseconds kSilence = std::chrono::seconds(10);
constexpr size_t kMaxErrorBytes = 1000;

v1::FleetLease described(const LeaseState& lease) {
  v1::FleetLease described;
  described.set_session(lease.session);
  described.set_tile(lease.id.tile);
  described.set_attempt(lease.id.attempt);
  described.set_seconds(lease.seconds);
  described.set_twice(lease.twice);
  return described;
}

v1::FleetSolve described(const JobState& job) {
  v1::FleetSolve solve;
  solve.set_session(job.session);
  if (!job.own) solve.set_server(job.server_address);
  solve.set_method(job.computes.substr(0, job.computes.find('/')));
  solve.set_tile_count(job.counts.tiles);
  solve.set_tiles_done(job.counts.done);
  solve.set_tiles_leased(job.counts.leased);
  solve.set_failures(job.counts.failures);
  solve.set_quarantined(job.counts.quarantined);
  solve.set_tiles_per_second(job.tiles_per_second);
  solve.set_held(job.suspended);
  solve.set_priority(job.priority == JobClass::kBatch         ? "batch"
                     : job.priority == JobClass::kInteractive ? "interactive"
                                                              : "normal");
  solve.set_owner(job.owner);
  const int left = job.counts.tiles - job.counts.done - job.counts.quarantined;
  if (!job.suspended && job.tiles_per_second > 0.0) solve.set_seconds_left(left / job.tiles_per_second);
  return solve;
}

// Whether the solves with deadlines end in time if each gets all solvers, the earliest first.
void enter_deadlines(std::span<const JobState> jobs, size_t solvers, v1::GetFleetResponse& fleet) {
  std::vector<size_t> order;
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (jobs[i].deadline != absl::InfiniteFuture()) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](size_t i) { return jobs[i].deadline; });
  double busy_s = 0.0;
  for (const size_t i : order) {
    const JobState& job = jobs[i];
    v1::FleetSolve& solve = *fleet.mutable_solves(static_cast<int>(i));
    solve.set_deadline(absl::FormatTime(absl::RFC3339_sec, job.deadline, absl::UTCTimeZone()));
    if (job.suspended || job.tile_seconds <= 0.0 || solvers == 0) continue;
    const int left = job.counts.tiles - job.counts.done - job.counts.quarantined;
    busy_s += left * job.tile_seconds / static_cast<double>(solvers);
    solve.set_late_s(std::max(0.0, busy_s - absl::ToDoubleSeconds(job.deadline - absl::Now())));
  }
}

}  // namespace

void Fleet::note(const std::string& name, const std::function<void(Solver&)>& change) {
  if (!check_name("node", name).ok()) return;
  const nanoseconds now = now_();
  const std::lock_guard lock(mutex_);
  std::erase_if(solvers_, [&](const auto& entry) { return now - entry.second.heard >= kForgotten; });
  Solver& solver = solvers_.try_emplace(name, now).first->second;
  solver.heard = now;
  heard_ = now;
  change(solver);
}

void Fleet::refused(const std::string& solver, const std::string& why) {
  note(solver, [&](Solver& known) { known.refused = why; });
}

void Fleet::claimed(const std::string& solver) {
  note(solver, [](Solver& known) { known.refused.clear(); });
}

void Fleet::completed(const std::string& solver, double seconds) {
  server_metrics().tiles_done.Increment();
  server_metrics().tile_seconds.Observe(seconds);
  note(solver, [&](Solver& known) {
    ++known.done;
    known.rate.add(known.heard);
  });
}

void Fleet::spoiled(const std::string& solver) {
  note(solver, [](Solver& known) { ++known.spoiled; });
}

int Fleet::spoiled_by(const std::string& solver) const {
  const std::lock_guard lock(mutex_);
  const auto found = solvers_.find(solver);
  return found == solvers_.end() ? 0 : found->second.spoiled;
}

void Fleet::failed(const std::string& solver, const std::string& session, int tile,
                   const std::string& error) {
  server_metrics().tiles_failed.Increment();
  note(solver, [&](Solver& known) {
    ++known.failed;
    known.last_error = fmt::format("{} tile {}: {}", session, tile, error.substr(0, kMaxErrorBytes));
  });
}

v1::GetFleetResponse Fleet::describe(const std::vector<RegisteredSolver>& solvers,
                                     const std::vector<JobState>& jobs, const std::vector<LeaseState>& leases,
                                     const std::string& store) const {
  const nanoseconds now = now_();
  std::map<std::string, v1::FleetSolver> described_solvers;
  const auto entry = [&](const std::string& name) -> v1::FleetSolver& {
    v1::FleetSolver& solver = described_solvers[name];
    solver.set_name(name);
    return solver;
  };
  std::set<std::string> registered;
  for (const auto& [node, info] : solvers) {
    registered.insert(node.name());
    v1::FleetSolver& solver = entry(node.name());
    solver.set_host(info.host());
    solver.set_version(node.version());
    solver.set_build(node.build());
    solver.set_threads(info.threads());
    solver.set_vectors(info.vectors());
    solver.set_up(node.up());
  }
  std::optional<nanoseconds> heard;
  {
    const std::lock_guard lock(mutex_);
    heard = heard_;
    for (const auto& [name, known] : solvers_) {
      if (now - known.heard >= kForgotten && !registered.contains(name)) continue;
      v1::FleetSolver& solver = entry(name);
      solver.set_refused(known.refused);
      solver.set_tiles_done(known.done);
      solver.set_tiles_failed(known.failed);
      solver.set_tiles_per_second(known.rate.per_second(now));
      solver.set_last_error(known.last_error);
      if (!registered.contains(name)) solver.set_up(now - known.heard < kSilence);
    }
  }
  for (const LeaseState& lease : leases) {
    v1::FleetSolver& solver = entry(lease.solver);
    *solver.add_leases() = described(lease);
    if (!registered.contains(lease.solver)) solver.set_up(true);
  }
  v1::GetFleetResponse response;
  if (heard) response.set_solver_heard(utc_rfc3339_ago(now - *heard));
  for (auto& [name, solver] : described_solvers) *response.add_solvers() = std::move(solver);
  for (const JobState& job : jobs) *response.add_solves() = described(job);
  enter_deadlines(jobs, std::ranges::count_if(response.solvers(), &v1::FleetSolver::up), response);
  response.set_store(store);
  return response;
}

}  // namespace glasswing
