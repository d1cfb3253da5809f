// The names and versions of the solving methods and the names of their options, so that a server can refuse
// unknown ones immediately. Only the solvers check the values of options.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace glasswing {

// The version of each method, and of the matte encoding ("matte"). Raised whenever a change of the code
// changes results for the same frames: tiles of different versions must not be joined into one matte.
const std::map<std::string, int>& method_versions();

// Empty for an unknown method.
std::span<const std::string_view> option_names(std::string_view method);

// INVALID_ARGUMENT lists the method's options.
absl::Status check_option(std::string_view method, std::string_view option);
// The error for an unknown option.
absl::Status unknown_option(std::string_view method, std::string_view option);

// "modes=2" as given to --set: the option's name, which must not be empty, and its value. INVALID_ARGUMENT.
absl::StatusOr<std::pair<std::string, std::string>> parse_setting(const std::string& setting);

}  // namespace glasswing
