// A stage that a program moves (core/process/move_command.h): "turn-table /dev/ttyUSB0 {position}".
#pragma once

#include <absl/status/statusor.h>

#include <chrono>

#include "camera-node/stage_drive.h"

namespace glasswing {

class CommandDrive final : public StageDrive {
 public:
  // The words of the commands are divided by spaces, and no shell sees them; in each, {axis} becomes the
  // axis's name and {position} the position. `home`: empty: the axes cannot be homed. INVALID_ARGUMENT: no
  // word of `move` has {position}.
  static absl::StatusOr<std::unique_ptr<CommandDrive>> create(
      const std::string& move, const std::string& home,
      std::chrono::milliseconds limit = std::chrono::seconds(120));

  // Errors: run_move_command()'s.
  absl::Status move(const StageAxis& axis, double position, std::stop_token stop) override;
  bool homes() const override { return !home_.empty(); }
  absl::Status home(const StageAxis& axis, std::stop_token stop) override;

 private:
  CommandDrive(std::vector<std::string> move, std::vector<std::string> home, std::chrono::milliseconds limit)
      : move_(std::move(move)), home_(std::move(home)), limit_(limit) {}
  absl::Status run(const std::vector<std::string>& words, const StageAxis& axis, double position,
                   std::stop_token stop) const;

  const std::vector<std::string> move_, home_;
  const std::chrono::milliseconds limit_;
};

}  // namespace glasswing
