// Names of sessions that a thread is to process, each once however often it was added.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <utility>

namespace glasswing {

// Thread-safe.
class SessionQueue {
 public:
  void add(const std::string& session) {
    const std::lock_guard lock(mutex_);
    names_.insert(session);
    added_.notify_all();
  }
  // Waits until there is a name, `at_most` has passed, or the thread is to stop; takes all of them.
  std::set<std::string> take(std::stop_token stop,
                             std::optional<std::chrono::milliseconds> at_most = std::nullopt) {
    std::unique_lock lock(mutex_);
    const auto is_ready = [this] { return !names_.empty(); };
    if (at_most) {
      added_.wait_for(lock, std::move(stop), *at_most, is_ready);
    } else {
      added_.wait(lock, std::move(stop), is_ready);
    }
    return std::exchange(names_, {});
  }

 private:
  std::mutex mutex_;
  std::condition_variable_any added_;
  std::set<std::string> names_;  // guarded by mutex_
};

}  // namespace glasswing
