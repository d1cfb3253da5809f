// Decides from a frame's pixels alone which stimulus it shows, for a camera that sees a monitor head-on,
// pixel on pixel. It judges the fault matrix, and therefore shares no code with the generators of patterns
// and id patches.
#pragma once

#include <optional>
#include <string>

#include "core/image/image.h"
#include "glasswing/v1/stimulus.pb.h"

namespace glasswing {

struct View {
  int pattern_rows = 0;   // above the id patch
  double step_px = 0.0;   // between neighbouring stripes
  double noise_sd = 0.0;  // maximum, of a sample; full scale is 1
};

// Returns nullopt if every part of the frame shows the stimulus, otherwise a description of what it shows.
// Bands of rows are judged separately, to detect a frame exposed while the picture changed.
std::optional<std::string> mismatch(const Image16& frame, const v1::Stimulus& stimulus, const View& view);

}  // namespace glasswing
