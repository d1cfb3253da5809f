// A method's options, from the arguments of --set.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <vector>

namespace glasswing {

// Each is NAME=VALUE; the last value of a repeated name wins. INVALID_ARGUMENT: one has no '=' or no name.
absl::StatusOr<std::map<std::string, std::string>> parse_settings(const std::vector<std::string>& settings);

}  // namespace glasswing
