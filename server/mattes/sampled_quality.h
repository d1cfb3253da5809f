#pragma once

#include <absl/status/statusor.h>

#include "core/file/positioned_file.h"
#include "server/sessions/matte_quality.h"

namespace glasswing {

// From at least 64 rows of the matte, evenly spaced, or from all. DATA_LOSS: it is damaged.
absl::StatusOr<MatteQuality> sampled_quality(const PositionedFile& matte);

}  // namespace glasswing
