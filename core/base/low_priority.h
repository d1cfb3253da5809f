// Work that yields the processor to whatever else this machine does, such as a capture.
#pragma once

#include <functional>

namespace glasswing {

// Runs `work` on a thread of its own at the lowest priority, as the threads are that it starts, and waits for
// its end.
void run_at_low_priority(const std::function<void()>& work);

}  // namespace glasswing
