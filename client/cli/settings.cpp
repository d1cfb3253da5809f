#include "client/cli/settings.h"

#include <fmt/format.h>

#include "core/method/methods.h"

namespace glasswing {

absl::StatusOr<std::map<std::string, std::string>> parse_settings(const std::vector<std::string>& settings) {
  std::map<std::string, std::string> options;
  for (const std::string& setting : settings) {
    const auto parsed = parse_setting(setting);
    if (!parsed.ok())
      return absl::InvalidArgumentError(
          fmt::format("--set is \"{}\"; it must be NAME=VALUE, such as modes=2", setting));
    options[parsed->first] = parsed->second;
  }
  return options;
}

}  // namespace glasswing
