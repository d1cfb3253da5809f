#include "camera-node/backends/command_drive.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>

#include "core/process/run_program.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<CommandDrive>> CommandDrive::create(const std::string& move,
                                                                   const std::string& home,
                                                                   std::chrono::milliseconds limit) {
  std::vector<std::string> words = command_words(move);
  if (words.empty() || move.find("{position}") == std::string::npos) {
    return absl::InvalidArgumentError(
        fmt::format("--axis-command is \"{}\"; it must be a program and its arguments, of which one has "
                    "{{position}}, such as \"turn-table /dev/ttyUSB0 {{position}}\"",
                    move));
  }
  return std::unique_ptr<CommandDrive>(new CommandDrive(std::move(words), command_words(home), limit));
}

absl::Status CommandDrive::move(const StageAxis& axis, double position, std::stop_token stop) {
  return run(move_, axis, position, std::move(stop));
}

absl::Status CommandDrive::home(const StageAxis& axis, std::stop_token stop) {
  return run(home_, axis, 0.0, std::move(stop));
}

absl::Status CommandDrive::run(std::vector<std::string> words, const StageAxis& axis, double position,
                               std::stop_token stop) const {
  for (std::string& word : words)
    word = absl::StrReplaceAll(word, {{"{position}", fmt::format("{}", position)}, {"{axis}", axis.name}});
  const absl::Status ended = run_command(words, {.limit = limit_, .stop = std::move(stop)});
  if (!absl::IsDeadlineExceeded(ended)) return ended;
  return absl::FailedPreconditionError(fmt::format("{} has not moved axis \"{}\" in {} s, and was ended",
                                                   words[0], axis.name,
                                                   std::chrono::duration<double>(limit_).count()));
}

}  // namespace glasswing
