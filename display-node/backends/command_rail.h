// A rail moved by a program (core/process/move_command.h): "zaber-move /dev/ttyUSB0 {mm}".
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <vector>

#include "display-node/rail.h"

namespace glasswing {

class CommandRail final : public Rail {
 public:
  // The words of `command` are separated by spaces, and no shell is involved; in each, {mm} becomes the
  // position and {monitor} the monitor's name. INVALID_ARGUMENT: no word has {mm}.
  static absl::StatusOr<std::unique_ptr<CommandRail>> create(
      const std::string& command, std::string monitor,
      std::chrono::milliseconds limit = std::chrono::seconds(60));

  // Errors: run_move_command()'s; also FAILED_PRECONDITION: stopped.
  absl::Status move(double position_mm, std::stop_token stop) override;

 private:
  CommandRail(std::vector<std::string> words, std::string monitor, std::chrono::milliseconds limit)
      : words_(std::move(words)), monitor_(std::move(monitor)), limit_(limit) {}

  const std::vector<std::string> words_;
  const std::string monitor_;
  const std::chrono::milliseconds limit_;
};

}  // namespace glasswing
