// A window of an X server that shows live composites.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "client/live/live_output.h"

namespace glasswing {

class LiveWindow {
 public:
  // UNAVAILABLE: there is no X server, or its screen does not have 24 bits.
  static absl::Status check_display();
  static absl::StatusOr<std::unique_ptr<LiveOutput>> open(int width_px, int height_px);
};

}  // namespace glasswing
