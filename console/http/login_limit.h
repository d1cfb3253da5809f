// Limits the refused logins of each address, so that guessing and filling the log are slow.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>

namespace glasswing {

// Thread-safe.
class LoginLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr int kMaxRefused = 10;
  static constexpr std::chrono::minutes kWindow{1};  // from an address's first refusal
  static constexpr size_t kMaxAddresses = 10000;     // beyond it the address refused first is forgotten

  // False: the address was refused kMaxRefused times in its window.
  bool allows(const std::string& address, Time now);
  void note_refused(const std::string& address, Time now);

 private:
  struct Refused {
    Time first;
    int count = 0;
  };
  void forget_old(Time now);

  std::mutex mutex_;
  std::map<std::string, Refused> refused_;  // by address
};

}  // namespace glasswing
