// Parts of statements on the table tiles.
#pragma once

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

// Before a statement that orders jobs: when each, each owner and each class last had a tile handed out or
// done. A class that never had counts from its oldest job.
inline constexpr char kServed[] =
    "WITH served AS (SELECT id, owner, priority, created, (SELECT max(used_at) FROM ("
    "SELECT max(done_at) AS used_at FROM tiles WHERE job = jobs.id AND done_attempt > 0 UNION ALL "
    "SELECT max(lease_since) FROM tiles WHERE job = jobs.id AND lease_attempt > 0) AS uses) AS used_at "
    "FROM jobs WHERE held = 0), "
    "owners AS (SELECT owner, max(used_at) AS used_at FROM served GROUP BY owner), "
    "classes AS (SELECT priority, coalesce(max(used_at), min(created)) AS used_at FROM served GROUP BY "
    "priority) ";
// Of jobs j that have joined their owner o and class c.
inline constexpr char kJobsServed[] =
    "jobs j JOIN owners o ON o.owner = j.owner JOIN classes c ON c.priority = j.priority";
inline std::string job_order(const JobStoreOptions& options) {
  return fmt::format(
      "CASE WHEN c.used_at < :now - {} THEN 0 ELSE 1 END, j.priority DESC, coalesce(o.used_at, 0), j.id",
      std::chrono::microseconds(options.class_waits).count());
}

}  // namespace glasswing
