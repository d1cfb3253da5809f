// A moment as people give it.
#pragma once

#include <absl/status/statusor.h>
#include <absl/time/time.h>

#include <string>

namespace glasswing {

// RFC 3339, UTC, from "7d" or "12h" (before `now`), "2026-11-01" (its start, UTC) or a moment of RFC 3339.
// INVALID_ARGUMENT names `option`.
absl::StatusOr<std::string> moment_of(const std::string& option, const std::string& text, absl::Time now);

}  // namespace glasswing
