// What `--set KEY=VALUE` says of a method's options.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <string>
#include <vector>

namespace glasswing {

// The last one counts where a key is given twice. INVALID_ARGUMENT: one is not of that form.
absl::StatusOr<std::map<std::string, std::string>> parse_settings(const std::vector<std::string>& settings);

}  // namespace glasswing
