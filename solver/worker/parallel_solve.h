// A stack solved band of rows by band, on several threads, its samples made light first, and the fall-off of
// camera and monitors taken out of the matte, as the archive's calibrations say.
#pragma once

#include <functional>
#include <stop_token>

#include "solver/method/method.h"

namespace glasswing {

// The matte of all rows of the stack. `thread_count` 0: one for each core. `stop` is looked at between bands;
// CANCELLED then. The first band's error, if one fails. `progress` hears of each band, from whatever thread,
// what part of the rows is solved.
absl::StatusOr<Matte> solve_in_bands(const Method& method, const FrameStack& stack, int thread_count = 0,
                                     std::stop_token stop = {},
                                     const std::function<void(double)>& progress = nullptr);

}  // namespace glasswing
