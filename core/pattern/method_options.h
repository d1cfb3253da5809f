// The names of the options that each way to solve has, for those who do not solve: a server refuses others at
// once. What values they take the solvers know.
#pragma once

#include <absl/status/status.h>

#include <span>
#include <string_view>

namespace glasswing {

// Empty: there is no such method.
std::span<const std::string_view> option_names(std::string_view method);

// INVALID_ARGUMENT lists the method's options.
absl::Status check_option(std::string_view method, std::string_view option);
// What it says of an option that is none.
absl::Status unknown_option(std::string_view method, std::string_view option);

}  // namespace glasswing
