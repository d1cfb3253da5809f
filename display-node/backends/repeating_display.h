// A lying display (--fault-repeat): at random an old picture stays on screen a refresh longer than reported.
// The LightTap behind it logs the truth.
#pragma once

#include <cstdint>
#include <random>

#include "display-node/display.h"

namespace glasswing {

class RepeatingDisplay final : public Display {
 public:
  // `repeat`: the probability that a picture is repeated. The display must outlive it.
  RepeatingDisplay(Display& display, double repeat, std::uint64_t seed)
      : display_(display), repeat_(repeat), random_(seed) {}

  std::string backend() const override { return display_.backend(); }
  const std::vector<ScreenInfo>& screens() const override { return display_.screens(); }
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

 private:
  Display& display_;
  std::bernoulli_distribution repeat_;
  std::mt19937_64 random_;
};

}  // namespace glasswing
