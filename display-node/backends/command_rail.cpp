#include "display-node/backends/command_rail.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/process/move_command.h"
#include "core/process/run_program.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<CommandRail>> CommandRail::create(const std::string& command,
                                                                 std::string monitor,
                                                                 std::chrono::milliseconds limit) {
  GW_RETURN_IF_ERROR(check_move_command("--rail-command", command, "{mm}", "move-stage /dev/ttyUSB0 {mm}"));
  return std::unique_ptr<CommandRail>(new CommandRail(command_words(command), std::move(monitor), limit));
}

absl::Status CommandRail::move(double position_mm, std::stop_token stop) {
  const absl::Status ended =
      run_move_command(words_, {{"{mm}", fmt::format("{}", position_mm)}, {"{monitor}", monitor_}},
                       "the monitor", limit_, std::move(stop));
  if (absl::IsCancelled(ended))
    return absl::FailedPreconditionError(words_[0] + " was terminated before it had moved the monitor");
  return ended;
}

}  // namespace glasswing
