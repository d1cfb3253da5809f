#include "client/cli/settings.h"

#include <fmt/format.h>

namespace glasswing {

absl::StatusOr<std::map<std::string, std::string>> parse_settings(const std::vector<std::string>& settings) {
  std::map<std::string, std::string> options;
  for (const std::string& setting : settings) {
    const size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0)
      return absl::InvalidArgumentError(fmt::format("--set is \"{}\"; it must be KEY=VALUE", setting));
    options[setting.substr(0, equals)] = setting.substr(equals + 1);
  }
  return options;
}

}  // namespace glasswing
