// Opens the screens that the command line names.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "display-node/display.h"
#include "display-node/display_options.h"

namespace glasswing {

// INVALID_ARGUMENT: an option cannot be read, or does not suit the backend; else the backend's own errors.
absl::StatusOr<std::unique_ptr<Display>> open_display(const DisplayOptions& options);

}  // namespace glasswing
