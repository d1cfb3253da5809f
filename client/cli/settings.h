// A method's options, from the arguments of --set.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <vector>

namespace glasswing {

// Each is KEY=VALUE; the last value of a repeated key wins. INVALID_ARGUMENT: one has no '=' or no key.
absl::StatusOr<std::map<std::string, std::string>> parse_settings(const std::vector<std::string>& settings);

}  // namespace glasswing
