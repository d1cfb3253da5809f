// A bad network: passes TCP on to an address, each direction's bytes up to `most` late, in their order.
#pragma once

#include <cstdint>
#include <list>
#include <mutex>
#include <string>
#include <thread>

#include "core/base/time.h"

namespace glasswing {

class DelayRelay {
 public:
  // `target`: "127.0.0.1:PORT", which may come up and go down.
  DelayRelay(const std::string& target, nanoseconds most, std::uint64_t seed);
  ~DelayRelay();
  const std::string& address() const { return address_; }

 private:
  void accept_all(std::stop_token stop);
  void pass(int from, int to, std::uint64_t seed, std::stop_token stop);

  const std::string target_;
  const nanoseconds most_;
  std::uint64_t seed_;
  int listener_ = -1;
  std::string address_;
  std::mutex mutex_;
  std::list<std::jthread> passing_;  // guarded by mutex_
  std::jthread accepting_;
};

}  // namespace glasswing
