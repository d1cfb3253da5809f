// Shares a daemon's calls out among the certificates that call it: each call holds a thread while it runs, so
// one caller must not take them all.
//
//   people      a viewer 1/16 of the calls, an operator 1/8, a console with all who use it as much as an
//               operator; viewers together 1/4, people together 1/2
//   programs    displays, cameras, solvers and servers 1/2 each
//
// So half of the calls stay for programs whatever people do, and a quarter for operators whatever viewers do.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <string>

#include "core/security/roles.h"

namespace glasswing {

// Thread-safe.
class CallShares {
 public:
  using Time = std::chrono::steady_clock::time_point;
  // A call that was admitted but has not begun by then was cancelled before.
  static constexpr std::chrono::seconds kBegins{30};

  explicit CallShares(int max_calls) : max_calls_(max_calls) {}
  void set_max_calls(int max_calls);

  // RESOURCE_EXHAUSTED: the caller, or all of its kind together, have as many calls as they may.
  absl::Status admit(const std::string& caller, Roles roles, Time now);
  // An admitted call begins to be answered, and ends.
  void begin(const std::string& caller, Roles roles);
  void end(const std::string& caller);

 private:
  enum class Kind { kViewer, kOperator, kProgram };
  struct Calls {
    Kind kind = Kind::kViewer;
    int running = 0;
    std::deque<Time> admitted;  // not begun yet, oldest first
    int count() const { return running + static_cast<int>(admitted.size()); }
  };
  static Kind kind_of(Roles roles);
  // These need mutex_.
  void forget(Time now);
  int count(Kind kind) const;

  std::mutex mutex_;
  int max_calls_;
  std::map<std::string, Calls> callers_;  // with calls, by certificate's name
};

// Those of this process.
CallShares& call_shares();

}  // namespace glasswing
