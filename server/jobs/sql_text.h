// Parts of statements on the table tiles.
#pragma once

#include <absl/time/clock.h>
#include <fmt/format.h>

#include <string>

#include "server/jobs/job_store.h"

namespace glasswing {

// Clauses that match indices: each must always be written in the same way.
inline constexpr char kOpen[] = "done_attempt = 0 AND quarantined = 0";
inline constexpr char kDone[] = "done_attempt > 0";
inline constexpr char kLeased[] = "lease_attempt > 0";

inline constexpr char kNoLease[] =
    "lease_attempt = 0, lease_solver = '', lease_since = 0, lease_until = 0, "
    "twin_attempt = 0, twin_solver = '', twin_since = 0, twin_until = 0";
// The attempt ?3 at tile ?2 of job ?1, if it is not void.
inline constexpr char kAttempt[] =
    "job = ?1 AND number = ?2 AND ?3 > 0 AND ?3 IN (lease_attempt, twin_attempt)";

// Before a statement that orders jobs: the class of each, and when it, its owner and its class last had a
// tile handed out or done. A class that never had counts from its oldest job. A job whose deadline is as near
// as all solvers need for what is left of it, with a fifth of that time lost otherwise, is of a class above
// all.
inline constexpr int kUrgent = static_cast<int>(JobClass::kInteractive) + 1;
inline std::string served() {
  return fmt::format(
      "WITH solvers AS (SELECT count(DISTINCT lease_solver) AS n FROM tiles WHERE {0} AND lease_until > "
      ":now), "
      "served AS (SELECT id, owner, created, deadline, CASE WHEN deadline > 0 AND deadline - {1} < "
      "(SELECT count(*) FROM tiles WHERE job = jobs.id AND {2}) * coalesce((SELECT avg(seconds) FROM (SELECT "
      "seconds FROM tiles WHERE job = jobs.id AND {3} ORDER BY done_at DESC LIMIT 100) AS last), 1.0) * "
      "1250000 "
      "/ (SELECT CASE WHEN n > 1 THEN n ELSE 1 END FROM solvers) THEN {4} ELSE priority END AS priority, "
      "(SELECT max(used_at) FROM ("
      "SELECT max(done_at) AS used_at FROM tiles WHERE job = jobs.id AND {3} UNION ALL "
      "SELECT max(lease_since) FROM tiles WHERE job = jobs.id AND {0}) AS uses) AS used_at "
      "FROM jobs WHERE held = 0), "
      "owners AS (SELECT owner, max(used_at) AS used_at FROM served GROUP BY owner), "
      "classes AS (SELECT priority, coalesce(max(used_at), min(created)) AS used_at FROM served GROUP BY "
      "priority) ",
      kLeased, absl::ToUnixMicros(absl::Now()), kOpen, kDone, kUrgent);
}
// Of jobs j that have joined themselves s, their owner o and class c.
inline constexpr char kJobsServed[] =
    "jobs j JOIN served s ON s.id = j.id JOIN owners o ON o.owner = s.owner JOIN classes c ON c.priority = "
    "s.priority";
inline std::string job_order(const JobStoreOptions& options) {
  return fmt::format(
      "CASE WHEN c.used_at < :now - {} THEN 0 ELSE 1 END, s.priority DESC, "
      "CASE WHEN s.priority = {} THEN s.deadline ELSE 0 END, coalesce(o.used_at, 0), j.id",
      std::chrono::microseconds(options.class_waits).count(), kUrgent);
}

}  // namespace glasswing
