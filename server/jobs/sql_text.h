// Parts of statements on the table tiles.
#pragma once

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

}  // namespace glasswing
