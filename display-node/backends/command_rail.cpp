#include "display-node/backends/command_rail.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>

#include "core/process/run_program.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<CommandRail>> CommandRail::create(const std::string& command,
                                                                 std::string monitor,
                                                                 std::chrono::milliseconds limit) {
  std::vector<std::string> words = command_words(command);
  if (command.find("{mm}") == std::string::npos || words.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "--rail-command is \"{}\"; it must be a program and its arguments, of which one has {{mm}}, such as "
        "\"move-stage /dev/ttyUSB0 {{mm}}\"",
        command));
  }
  return std::unique_ptr<CommandRail>(new CommandRail(std::move(words), std::move(monitor), limit));
}

absl::Status CommandRail::move(double position_mm, std::stop_token stop) {
  std::vector<std::string> words;
  for (const std::string& word : words_)
    words.push_back(
        absl::StrReplaceAll(word, {{"{mm}", fmt::format("{}", position_mm)}, {"{monitor}", monitor_}}));
  const absl::Status ended = run_command(words, {.limit = limit_, .stop = std::move(stop)});
  if (absl::IsDeadlineExceeded(ended)) {
    return absl::FailedPreconditionError(
        fmt::format("{} has not moved the monitor in {} s, and was "
                    "terminated",
                    words[0], std::chrono::duration<double>(limit_).count()));
  }
  if (absl::IsCancelled(ended))
    return absl::FailedPreconditionError(words[0] + " was terminated before it had moved the monitor");
  return ended;
}

}  // namespace glasswing
