// The motor of a simulated turntable.
#pragma once

#include <functional>
#include <optional>

#include "camera-node/stage_drive.h"

namespace glasswing {

class SimDrive final : public StageDrive {
 public:
  // `turn` lets the object stand at an angle. `speed`: degrees a second; empty: moves take no time.
  SimDrive(std::function<void(double degrees)> turn, std::optional<double> speed)
      : turn_(std::move(turn)), speed_(speed) {}

  // A stopped motor stands where it was.
  absl::Status move(const StageAxis& axis, double position, std::stop_token stop) override;
  absl::Status home(const StageAxis& axis, std::stop_token stop) override {
    return move(axis, 0.0, std::move(stop));
  }

 private:
  const std::function<void(double)> turn_;
  const std::optional<double> speed_;
  double at_deg_ = 0.0;
};

}  // namespace glasswing
