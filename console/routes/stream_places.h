// Places for event streams, each of which occupies a thread: one person's open pages must not keep others
// out.
#pragma once

#include <map>
#include <mutex>
#include <string>

namespace glasswing {

// Thread-safe.
class StreamPlaces {
 public:
  static constexpr size_t kMax = 48, kMaxOfOne = 16;

  // False: none is free, or none for this principal. Otherwise leave() must follow.
  bool take(const std::string& principal) {
    const std::lock_guard lock(mutex_);
    size_t& held = held_[principal];
    if (count_ >= kMax || held >= kMaxOfOne) {
      if (held == 0) held_.erase(principal);
      return false;
    }
    ++held;
    ++count_;
    return true;
  }
  void leave(const std::string& principal) {
    const std::lock_guard lock(mutex_);
    const auto held = held_.find(principal);
    if (--held->second == 0) held_.erase(held);
    --count_;
  }

 private:
  std::mutex mutex_;
  std::map<std::string, size_t> held_;  // by principal; guarded by mutex_
  size_t count_ = 0;                    // guarded by mutex_
};

}  // namespace glasswing
