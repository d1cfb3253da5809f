#include "server/solve/single_flight.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <thread>
#include <vector>

namespace glasswing {
namespace {

TEST(SingleFlight, AloneItRunsEachTime) {
  SingleFlight work;
  int runs = 0;
  for (int i = 0; i < 3; ++i) work.run([&] { ++runs; });
  EXPECT_EQ(runs, 3);
}

// A run that began after a thread asked sees what the thread did before.
TEST(SingleFlight, EachIsServedByARunAfterItAskedAndNoTwoRunAtOnce) {
  constexpr int kThreads = 8, kTimes = 500;
  SingleFlight work;
  std::atomic<int> done = 0, seen = 0;
  std::atomic<bool> running = false;
  std::latch begin(kThreads);
  std::vector<std::jthread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      begin.arrive_and_wait();
      for (int i = 0; i < kTimes; ++i) {
        const int own = ++done;
        work.run([&] {
          EXPECT_FALSE(running.exchange(true));
          seen = done.load();
          running = false;
        });
        EXPECT_GE(seen, own);
      }
    });
  }
  threads.clear();
  EXPECT_EQ(seen, kThreads * kTimes);
}

}  // namespace
}  // namespace glasswing
