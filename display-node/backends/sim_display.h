// Simulated monitors: refreshes at a steady rate on CLOCK_MONOTONIC.
#pragma once

#include <cstdint>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

class SimDisplay final : public Display {
 public:
  struct Faults {
    std::uint64_t seed = 1;
    double missed_flips = 0.0;  // probability that a flip is a refresh late
    nanoseconds jitter{};       // each scan-out begins up to this late, as reported; less than a refresh
  };
  SimDisplay(std::vector<ScreenInfo> screens, Faults faults);

  std::string backend() const override { return "sim"; }
  const std::vector<ScreenInfo>& screens() const override { return screens_; }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

 private:
  const std::vector<ScreenInfo> screens_;
  const Faults faults_;
  const nanoseconds phase_;
  std::mt19937_64 random_;
  std::vector<std::int64_t> shown_;  // each monitor's last refresh with a new picture
};

}  // namespace glasswing
