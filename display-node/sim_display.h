// Simulated monitors: refreshes at a steady rate on CLOCK_MONOTONIC, and a tap for what was emitted.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

// A picture that starts its scan-out, on monitor screens()[monitor].
struct Emission {
  size_t monitor = 0;
  nanoseconds scanout_start{};
  Picture picture;
};

class SimDisplay final : public Display {
 public:
  struct Faults {
    std::uint64_t seed = 1;
    double missed_flips = 0.0;  // probability that a flip comes a refresh late
  };
  SimDisplay(std::vector<ScreenInfo> screens, Faults faults);

  std::string backend() const override { return "sim"; }
  const std::vector<ScreenInfo>& screens() const override { return screens_; }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

  // Everything emitted since `cursor` (0: what is on screen now, and what follows), and a time before which
  // nothing else starts. Waits up to `timeout` for something new. False: the reader has fallen too far
  // behind.
  bool read_emissions(std::uint64_t& cursor, std::vector<Emission>& emissions, nanoseconds& horizon,
                      std::chrono::milliseconds timeout);

 private:
  const std::vector<ScreenInfo> screens_;
  const double missed_flips_;
  const nanoseconds phase_;
  const size_t log_limit_;
  std::mutex mutex_;
  std::condition_variable emitted_;
  std::mt19937_64 random_;         // guarded by mutex_
  std::vector<Emission> current_;  // guarded by mutex_, one a monitor; it may still wait for its refresh,
  std::vector<Emission> before_;   // guarded by mutex_, and until then this one is on screen
  std::deque<Emission> log_;       // guarded by mutex_, the newest log_limit_
  std::uint64_t next_ = 1;         // guarded by mutex_, number of the next emission
};

}  // namespace glasswing
