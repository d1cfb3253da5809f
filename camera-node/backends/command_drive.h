// A stage that a program moves, once for each move: "turn-table /dev/ttyUSB0 {position}". It succeeds (exit
// status 0) when the axis stands there.
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

  // FAILED_PRECONDITION: the program cannot be run, or failed: has the last line of what it said. After
  // `limit`, and when stopped, it gets SIGTERM, and is killed two seconds later.
  absl::Status move(const StageAxis& axis, double position, std::stop_token stop) override;
  bool homes() const override { return !home_.empty(); }
  absl::Status home(const StageAxis& axis, std::stop_token stop) override;

 private:
  CommandDrive(std::vector<std::string> move, std::vector<std::string> home, std::chrono::milliseconds limit)
      : move_(std::move(move)), home_(std::move(home)), limit_(limit) {}
  absl::Status run(std::vector<std::string> words, const StageAxis& axis, double position,
                   std::stop_token stop) const;

  const std::vector<std::string> move_, home_;
  const std::chrono::milliseconds limit_;
};

}  // namespace glasswing
