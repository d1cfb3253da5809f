#include "core/process/low_priority.h"

#include <sys/resource.h>

#include <thread>

namespace glasswing {

void run_at_low_priority(const std::function<void()>& work) {
  constexpr int kLowest = 19;
  // A thread cannot raise its priority again, so this one ends with its work.
  std::jthread([&work] {
    (void)::setpriority(PRIO_PROCESS, 0, kLowest);  // on Linux of this thread alone
    work();
  }).join();
}

}  // namespace glasswing
