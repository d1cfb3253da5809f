// Clocks of this machine. Every node stamps in its own NodeClock; physical time is what a simulated
// display and a simulated camera share.
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

}  // namespace glasswing
