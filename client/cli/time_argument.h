// Parses a point in time given on the command line.
#pragma once

#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <string>

namespace glasswing {

// Returns RFC 3339 in UTC. `text` is "7d" or "12h" (before `now`), "2026-11-01" (its start, UTC), or RFC
// 3339. INVALID_ARGUMENT names `option`.
absl::StatusOr<std::string> parse_time_argument(const std::string& option, const std::string& text,
                                                absl::Time now);

}  // namespace glasswing
