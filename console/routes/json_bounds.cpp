#include "console/routes/json_bounds.h"

#include <fmt/format.h>

namespace glasswing {

absl::Status check_json_bounds(std::string_view text) {
  int depth = 0, objects = 0, values = 0;
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      ++depth;
      ++objects;
    } else if (c == '}' || c == ']') {
      --depth;
    } else if (c == ',') {
      ++values;
    }
    if (depth > kMaxJsonDepth)
      return absl::InvalidArgumentError(fmt::format("the JSON nests deeper than {} levels", kMaxJsonDepth));
    if (objects > kMaxJsonObjects || values > kMaxJsonValues) {
      return absl::InvalidArgumentError(
          fmt::format("the JSON has more than {} objects and lists, or more than {} values", kMaxJsonObjects,
                      kMaxJsonValues));
    }
  }
  return absl::OkStatus();
}

}  // namespace glasswing
