#include "core/base/name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <random>

namespace glasswing {
namespace {

constexpr size_t kMaxLength = 64;

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}
bool is_of_names(char c) {
  return is_letter_or_digit(c) || c == '.' || c == '_' || c == '-';
}

bool is_good(std::string_view name) {
  return !name.empty() && name.size() <= kMaxLength && is_letter_or_digit(name[0]) &&
         std::ranges::all_of(name, is_of_names);
}

// The letters of U+00C0 to U+00FF, which UTF-8 writes as 0xC3 and 0x80 to 0xBF.
constexpr std::array<std::string_view, 64> kLatin{
    "A", "A", "A", "A", "Ae", "A", "Ae", "C", "E", "E", "E", "E", "I",  "I", "I",  "I",
    "D", "N", "O", "O", "O",  "O", "Oe", "_", "O", "U", "U", "U", "Ue", "Y", "Th", "ss",
    "a", "a", "a", "a", "ae", "a", "ae", "c", "e", "e", "e", "e", "i",  "i", "i",  "i",
    "d", "n", "o", "o", "o",  "o", "oe", "_", "o", "u", "u", "u", "ue", "y", "th", "y"};

// "Grosse_Vase" for "Große Vase"; empty if nothing is left.
std::string spelled(std::string_view text) {
  std::string name;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]),
               next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (byte == 0xC3 && next >= 0x80 && next <= 0xBF) {
      name += kLatin[next - 0x80u];
      ++i;
    } else if (byte == 0xCC && next == 0x88) {  // two dots on the letter before
      name += 'e';
      ++i;
    } else if (is_of_names(text[i])) {
      name += text[i];
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  name.erase(0, static_cast<size_t>(std::ranges::find_if(name, is_letter_or_digit) - name.begin()));
  name.resize(std::min(name.size(), kMaxLength));
  while (name.ends_with('_')) name.pop_back();
  return name;
}

}  // namespace

absl::Status check_name(std::string_view what, std::string_view name) {
  if (is_good(name)) return absl::OkStatus();
  const std::string other = spelled(name);
  return absl::InvalidArgumentError(
      fmt::format("{} name is \"{}\"; it must be 1 to {} letters, digits, '.', '_' or '-', and start with a "
                  "letter or digit{}",
                  what, name, kMaxLength, other.empty() ? "" : fmt::format(": \"{}\", say", other)));
}

std::string random_token() {
  std::random_device entropy;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", entropy(), entropy(), entropy(), entropy());
}

}  // namespace glasswing
