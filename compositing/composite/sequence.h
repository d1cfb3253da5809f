// Composites of many frames: for a directory with a matte for each frame, or for one matte over moving
// backdrops.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "compositing/composite/arguments.h"
#include "core/matte/matte.h"

namespace glasswing {

// True if the arguments request several pictures.
bool is_video(const CompositeArguments& arguments);

struct Composited {
  int frames = 0;
  std::vector<std::string> warnings;  // of the mattes
  PixelCount pixels;
};

// Errors name the matte at fault; pictures already written are kept.
absl::StatusOr<Composited> composite_sequence(const CompositeArguments& arguments);

}  // namespace glasswing
