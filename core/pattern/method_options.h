// The names and versions of the ways to solve, and the names of the options that each has, for those who do
// not solve: a server refuses others at once. What values they take the solvers know.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace glasswing {

// What each method computes, and how mattes are written ("matte"). Raised whenever a change of the code makes
// other numbers of the same frames: tiles of two versions must not meet in one matte.
const std::map<std::string, int>& method_versions();

// Empty: there is no such method.
std::span<const std::string_view> option_names(std::string_view method);

// INVALID_ARGUMENT lists the method's options.
absl::Status check_option(std::string_view method, std::string_view option);
// What it says of an option that is none.
absl::Status unknown_option(std::string_view method, std::string_view option);

// Splits "NAME=VALUE", the argument of --set. VALUE may be empty and may contain '='. INVALID_ARGUMENT: there
// is no '=', or NAME is empty.
absl::StatusOr<std::pair<std::string, std::string>> parse_setting(const std::string& setting);

}  // namespace glasswing
