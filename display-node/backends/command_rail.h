// A rail moved by a program, which is run once for each move: "zaber-move /dev/ttyUSB0 {mm}". It succeeds
// (exit status 0) when the monitor has arrived.
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

  // FAILED_PRECONDITION: the program cannot be run, or failed: the message has its last line of output. After
  // `limit`, and when stopped, it gets SIGTERM, and is killed two seconds later.
  absl::Status move(double position_mm, std::stop_token stop) override;

 private:
  CommandRail(std::vector<std::string> words, std::string monitor, std::chrono::milliseconds limit)
      : words_(std::move(words)), monitor_(std::move(monitor)), limit_(limit) {}

  const std::vector<std::string> words_;
  const std::string monitor_;
  const std::chrono::milliseconds limit_;
};

}  // namespace glasswing
