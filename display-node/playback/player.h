// Plays a program: one step every hold_refreshes refreshes, with no RPC in the loop.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "display-node/display.h"
#include "display-node/playback/program.h"

namespace glasswing {

// Calls `report` for every step and monitor as it is replaced; the last step is replaced by black. Step i
// goes on screen at the first refresh at or after start + i step; if `step` is 0, when the one before was
// held. DEADLINE_EXCEEDED: `start` has passed. CANCELLED: stopped; the screens are black then too.
absl::Status play(const Program& program, Display& display, nanoseconds start, nanoseconds step,
                  std::stop_token stop, const std::function<void(const v1::Presentation&)>& report);

}  // namespace glasswing
