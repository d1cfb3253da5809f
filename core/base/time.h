// Clocks of this machine. Every node timestamps with its own NodeClock; simulated displays and cameras also
// share physical time, the machine's CLOCK_MONOTONIC.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace glasswing {

using std::chrono::nanoseconds;

// CLOCK_MONOTONIC now.
nanoseconds monotonic_now();

// Sleeps until `deadline` on CLOCK_MONOTONIC.
void sleep_until_monotonic(nanoseconds deadline);

// "2026-01-31T12:00:00Z"
std::string utc_now_rfc3339();
// The time that long ago.
std::string utc_rfc3339_ago(nanoseconds ago);

}  // namespace glasswing
