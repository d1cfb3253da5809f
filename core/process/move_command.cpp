#include "core/process/move_command.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>

#include "core/process/run_program.h"

namespace glasswing {

absl::Status check_move_command(std::string_view option, std::string_view command, std::string_view place,
                                std::string_view example) {
  if (command.find(place) != std::string_view::npos) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is \"{}\"; it must be a program and its arguments, of which one has {}, such as \"{}\"",
                  option, command, place, example));
}

absl::Status run_move_command(std::vector<std::string> words,
                              const std::vector<std::pair<std::string, std::string>>& values,
                              std::string_view what, std::chrono::milliseconds limit, std::stop_token stop) {
  for (std::string& word : words) word = absl::StrReplaceAll(word, values);
  const absl::Status ended = run_command(words, {.limit = limit, .stop = std::move(stop)});
  if (!absl::IsDeadlineExceeded(ended)) return ended;
  return absl::FailedPreconditionError(fmt::format("{} has not moved {} in {} s, and was terminated",
                                                   words[0], what,
                                                   std::chrono::duration<double>(limit).count()));
}

}  // namespace glasswing
