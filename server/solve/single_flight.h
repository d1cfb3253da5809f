// Coalesces concurrent requests: one run serves every caller that arrived before it started; later callers
// share the next run.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>

namespace glasswing {

class SingleFlight {
 public:
  // Returns when `work` has run to its end after this call began, on this thread or another; never on two at
  // once.
  void run(const std::function<void()>& work) {
    std::unique_lock lock(mutex_);
    const std::uint64_t ticket = ++asked_;
    done_changed_.wait(lock, [&] { return !running_ || done_ >= ticket; });
    if (done_ >= ticket) return;
    running_ = true;
    const std::uint64_t serves = asked_;
    lock.unlock();
    work();
    lock.lock();
    running_ = false;
    done_ = serves;
    done_changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable done_changed_;
  std::uint64_t asked_ = 0, done_ = 0;  // guarded by mutex_
  bool running_ = false;                // guarded by mutex_
};

}  // namespace glasswing
