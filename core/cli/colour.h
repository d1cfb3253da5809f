// Terminal colours.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace glasswing {

enum class Paint { kNone = 0, kBad = 31, kGood = 32, kCaution = 33 };  // SGR codes

// True if output to `fd` is coloured. `when`: auto (on a terminal, unless NO_COLOR is set: no-color.org),
// always or never.
inline bool is_coloured(const std::string& when, int fd) {
  const char* no_color = std::getenv("NO_COLOR");
  const bool wanted = no_color == nullptr || *no_color == '\0';
  return when == "always" || (when == "auto" && wanted && ::isatty(fd) == 1);
}

// The colour of a state or of a finding's level.
inline Paint paint_of(const std::string& word) {
  if (word == "ok" || word == "up" || word == "captured" || word == "done") return Paint::kGood;
  if (word == "warning" || word == "paused" || word == "held") return Paint::kCaution;
  if (word == "problem" || word == "away" || word == "refused" || word == "failed") return Paint::kBad;
  return Paint::kNone;
}

inline std::string painted(const std::string& text, Paint paint) {
  return paint == Paint::kNone ? text : fmt::format("\x1b[{}m{}\x1b[m", static_cast<int>(paint), text);
}

}  // namespace glasswing
