// Parses a monitor given on the command line or in a list of photographs.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// From "back:1920x1080", or "1920x1080" for a monitor called "monitor". INVALID_ARGUMENT: it is not of that
// form, or a side is not 1 to kMaxSide_px.
absl::StatusOr<v1::Monitor> parse_monitor_argument(const std::string& text);

}  // namespace glasswing
