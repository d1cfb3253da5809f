#include "solver/method/frame_correction.h"

#include <algorithm>
#include <set>

namespace glasswing {

std::vector<int> with_needed(const std::vector<int>& frames, const FrameCorrections* corrections,
                             const std::vector<int>& known) {
  if (corrections == nullptr) return frames;
  std::set<int> all(frames.begin(), frames.end());
  const bool ghosts = corrections->ghost != std::array<float, 3>{};
  const auto need = [&](int frame) {
    if (std::ranges::binary_search(known, frame)) all.insert(frame);
  };
  for (const int frame : frames) {
    const GrayFrames& grays = corrections->of_frame[frame].grays;
    need(grays.gray);
    need(grays.black);
  }
  if (!ghosts) return {all.begin(), all.end()};
  for (const int frame : std::vector<int>(all.begin(), all.end())) {
    for (const int before : corrections->of_frame[frame].before) need(before);
  }
  return {all.begin(), all.end()};
}

}  // namespace glasswing
