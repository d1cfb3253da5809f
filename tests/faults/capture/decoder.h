// Reads from a frame's pixels alone what a camera that looks straight at a monitor, pixel on pixel, was
// shown: the judge of the fault matrix. It shares nothing with what draws patterns and id patches.
#pragma once

#include <optional>
#include <string>

#include "core/frame/image.h"
#include "glasswing/v1/stimulus.pb.h"

namespace glasswing {

struct View {
  int pattern_rows = 0;   // below them lies the id patch
  double step_px = 0.0;   // between neighbouring stripes
  double noise_sd = 0.0;  // of a sample, full scale 1, at most
};

// Nothing if every part of the frame shows the stimulus; else what is seen instead. Bands of rows are judged
// each for itself, so that a frame exposed while the picture changed is found out.
std::optional<std::string> mismatch(const Image16& frame, const v1::Stimulus& stimulus, const View& view);

}  // namespace glasswing
