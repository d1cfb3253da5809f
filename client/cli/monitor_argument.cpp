#include "client/cli/monitor_argument.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/frame/archive.h"

namespace glasswing {

absl::StatusOr<v1::Monitor> parse_monitor_argument(const std::string& text) {
  const size_t colon = text.find(':');
  const std::string name = colon == std::string::npos ? "monitor" : text.substr(0, colon);
  const std::string size = colon == std::string::npos ? text : text.substr(colon + 1);
  int width_px = 0, height_px = 0;
  const auto good = [](int side_px) { return side_px >= 1 && side_px <= kMaxSide_px; };
  if (!Scanner(size).number(width_px).then("x").number(height_px).done() || !good(width_px) ||
      !good(height_px) || !check_name("monitor", name).ok()) {
    return absl::InvalidArgumentError(
        fmt::format("monitor is \"{}\"; it must be NAME:WIDTHxHEIGHT, such as back:1920x1080, or "
                    "WIDTHxHEIGHT, each side 1 to {} px",
                    text, kMaxSide_px));
  }
  v1::Monitor monitor;
  monitor.set_name(name);
  monitor.set_width_px(width_px);
  monitor.set_height_px(height_px);
  monitor.set_response("linear");
  return monitor;
}

}  // namespace glasswing
