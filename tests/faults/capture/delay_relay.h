// A slow network: relays TCP to an address, and delays the bytes of each direction by up to `max_delay`, in
// order.
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
  DelayRelay(const std::string& target, nanoseconds max_delay, std::uint64_t seed);
  ~DelayRelay();
  const std::string& address() const { return address_; }

 private:
  void accept_all(std::stop_token stop);
  void pass(int from, int to, std::uint64_t seed, std::stop_token stop);

  const std::string target_;
  const nanoseconds max_delay_;
  std::uint64_t seed_;
  int listener_ = -1;
  std::string address_;
  std::mutex mutex_;
  std::list<std::jthread> passing_;  // guarded by mutex_
  std::jthread accepting_;
};

}  // namespace glasswing
