// A simulated rail: the light that a simulated camera sees then comes from a different place.
#pragma once

#include "display-node/backends/light_tap.h"
#include "display-node/rail.h"

namespace glasswing {

class SimRail final : public Rail {
 public:
  // At `own_place_mm` the monitor, screens()[monitor], is at its normal place. `pose`: of the monitor on the
  // rail. The tap must outlive it.
  SimRail(LightTap& tap, size_t monitor, double own_place_mm, PanelPose pose)
      : tap_(tap), monitor_(monitor), own_place_mm_(own_place_mm), pose_(pose) {}

  // The simulated motor finishes at once.
  absl::Status move(double position_mm, std::stop_token) override {
    pose_.away_mm = position_mm - own_place_mm_;
    tap_.place(monitor_, pose_);
    return absl::OkStatus();
  }

 private:
  LightTap& tap_;
  const size_t monitor_;
  const double own_place_mm_;
  PanelPose pose_;
};

}  // namespace glasswing
