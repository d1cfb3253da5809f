#include "core/base/name.h"

#include <fmt/format.h>

#include <algorithm>
#include <random>

namespace glasswing {
namespace {

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

absl::Status check_name(std::string_view what, std::string_view name) {
  const bool good = !name.empty() && name.size() <= 64 && is_letter_or_digit(name[0]) &&
                    std::all_of(name.begin(), name.end(), [](char c) {
                      return is_letter_or_digit(c) || c == '.' || c == '_' || c == '-';
                    });
  if (good) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} name is \"{}\"; it must be 1 to 64 letters, digits, '.', '_' or '-', and start with a "
                  "letter or digit",
                  what, name));
}

std::string random_token() {
  std::random_device entropy;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", entropy(), entropy(), entropy(), entropy());
}

}  // namespace glasswing
