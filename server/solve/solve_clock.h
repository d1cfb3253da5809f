// How long the solves of this server have taken.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// Thread-safe.
class SolveClock {
 public:
  // Time that the solve has already taken counts.
  void start(const v1::Session& session) {
    const std::chrono::duration<double> so_far(session.solve_seconds());
    const std::lock_guard lock(mutex_);
    began_[session.name()] = monotonic_now() - std::chrono::duration_cast<nanoseconds>(so_far);
  }
  void stop(const std::string& session) {
    const std::lock_guard lock(mutex_);
    began_.erase(session);
  }
  // Empty: the session's solve was not started.
  std::optional<double> seconds(const std::string& session) const {
    const std::lock_guard lock(mutex_);
    const auto began = began_.find(session);
    if (began == began_.end()) return std::nullopt;
    return std::chrono::duration<double>(monotonic_now() - began->second).count();
  }
  std::vector<std::string> started() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> sessions;
    for (const auto& [session, began] : began_) sessions.push_back(session);
    return sessions;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, nanoseconds> began_;  // guarded by mutex_
};

}  // namespace glasswing
