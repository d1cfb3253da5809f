#include "camera-node/backends/sim_drive.h"

#include <algorithm>
#include <cmath>

#include "core/process/pause.h"

namespace glasswing {

absl::Status SimDrive::move(const StageAxis&, double position, std::stop_token stop) {
  constexpr std::chrono::milliseconds kTick(10);
  while (speed_ && at_deg_ != position) {
    if (!pause(stop, kTick)) return absl::CancelledError("stopped");
    const double step = *speed_ * std::chrono::duration<double>(kTick).count();
    at_deg_ += std::clamp(position - at_deg_, -step, step);
    turn_(at_deg_);
  }
  if (stop.stop_requested()) return absl::CancelledError("stopped");
  at_deg_ = position;
  turn_(at_deg_);
  return absl::OkStatus();
}

}  // namespace glasswing
