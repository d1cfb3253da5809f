#include "camera-node/backends/command_drive.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/process/move_command.h"
#include "core/process/run_program.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<CommandDrive>> CommandDrive::create(const std::string& move,
                                                                   const std::string& home,
                                                                   std::chrono::milliseconds limit) {
  GW_RETURN_IF_ERROR(
      check_move_command("--axis-command", move, "{position}", "turn-table /dev/ttyUSB0 {position}"));
  return std::unique_ptr<CommandDrive>(new CommandDrive(command_words(move), command_words(home), limit));
}

absl::Status CommandDrive::move(const StageAxis& axis, double position, std::stop_token stop) {
  return run(move_, axis, position, std::move(stop));
}

absl::Status CommandDrive::home(const StageAxis& axis, std::stop_token stop) {
  return run(home_, axis, 0.0, std::move(stop));
}

absl::Status CommandDrive::run(const std::vector<std::string>& words, const StageAxis& axis, double position,
                               std::stop_token stop) const {
  return run_move_command(words, {{"{position}", fmt::format("{}", position)}, {"{axis}", axis.name}},
                          fmt::format("axis \"{}\"", axis.name), limit_, std::move(stop));
}

}  // namespace glasswing
