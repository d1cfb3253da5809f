// Work that yields the processor to everything else on this machine, such as a capture.
#pragma once

#include <functional>

namespace glasswing {

// Runs `work` on its own thread at the lowest priority, which its child threads inherit, and waits for its
// end.
void run_at_low_priority(const std::function<void()>& work);

}  // namespace glasswing
