#include "core/process/low_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <thread>

namespace glasswing {
namespace {

TEST(LowPriority, IsThatOfTheWorkAndItsThreadsAlone) {
  const int before = ::getpriority(PRIO_PROCESS, 0);
  int of_work = 0, of_its_thread = 0;
  run_at_low_priority([&] {
    of_work = ::getpriority(PRIO_PROCESS, 0);
    std::jthread([&] { of_its_thread = ::getpriority(PRIO_PROCESS, 0); }).join();
  });
  EXPECT_EQ(of_work, 19);
  EXPECT_EQ(of_its_thread, 19);
  EXPECT_EQ(::getpriority(PRIO_PROCESS, 0), before);
}

}  // namespace
}  // namespace glasswing
