// Plays a program: one step every hold_refreshes refreshes, with no RPC in the loop.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "display-node/display.h"
#include "display-node/playback/program.h"

namespace glasswing {

// Calls `report` for every step and monitor when the step is replaced; black replaces the last step. Step i
// goes on screen at the first refresh at or after start + i step, or, if `step` is 0, after the previous step
// has been shown for hold_refreshes. DEADLINE_EXCEEDED: `start` has passed. CANCELLED: stopped; the screens
// are then also black. `hold_last`: the last step stays until `stop`, and is reported as soon as it is shown.
absl::Status play(const Program& program, Display& display, nanoseconds start, nanoseconds step,
                  std::stop_token stop, const std::function<void(const v1::Presentation&)>& report,
                  bool hold_last = false);

}  // namespace glasswing
