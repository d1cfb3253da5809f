// Composites of many frames: of a directory with a matte for each frame, or of one matte over moving
// backdrops.
#pragma once

#include <absl/status/statusor.h>

#include "compositing/composite/arguments.h"

namespace glasswing {

// True if the arguments ask for several pictures.
bool is_video(const CompositeArguments& arguments);

// Returns the number of pictures. Errors name the matte at fault; pictures already written are kept.
absl::StatusOr<int> composite_sequence(const CompositeArguments& arguments);

}  // namespace glasswing
