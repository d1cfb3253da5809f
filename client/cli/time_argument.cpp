#include "client/cli/time_argument.h"

#include <fmt/format.h>

#include <charconv>

namespace glasswing {

absl::StatusOr<std::string> parse_time_argument(const std::string& option, const std::string& text,
                                                absl::Time now) {
  absl::Time time;
  std::string why;
  int count = 0;
  const char* const end = text.data() + text.size();
  const auto number = std::from_chars(text.data(), end, count);
  const bool ago = number.ec == std::errc() && count >= 0 && number.ptr + 1 == end &&
                   (*number.ptr == 'd' || *number.ptr == 'h');
  if (ago) {
    time = now - absl::Hours(*number.ptr == 'd' ? 24.0 * count : count);
  } else if (!absl::ParseTime("%Y-%m-%d", text, absl::UTCTimeZone(), &time, &why) &&
             !absl::ParseTime(absl::RFC3339_full, text, &time, &why)) {
    return absl::InvalidArgumentError(fmt::format(
        "{} is \"{}\"; it must be of the form 7d, 12h, 2026-11-01 or 2026-11-01T12:00:00Z", option, text));
  }
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", time, absl::UTCTimeZone());
}

}  // namespace glasswing
