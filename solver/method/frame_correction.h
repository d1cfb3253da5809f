// What is removed from the frames of a session before they are solved:
//
//   light'_f = (light_f - sum over k of ghost_k light_(f-k) - offset_f) / gain_f
//
// where f - k is the k-th frame before f in time. The light of samples saturated in a picture of white is
// taken from a gray picture of the same: black' + (gray' - black') / level. Then frames are moved back
// (frame_registration.h).
#pragma once

#include <array>
#include <vector>

namespace glasswing {

// A gray picture, of `level` of the light of another, and black.
struct GrayFrames {
  int gray = -1, black = -1;
  float level = 1.0f;
};

struct FrameCorrection {
  std::array<float, 3> gain{1.0f, 1.0f, 1.0f}, offset{};  // by channel
  std::array<int, 3> before{-1, -1, -1};                  // frames whose ghosts it has, the latest first
  GrayFrames grays;                                       // tell what is saturated; none: it stays so
  // What other frames have at (x, y) is at (x + dx - turn y, y + dy + turn x), px from the top left one.
  float dx_px = 0.0f, dy_px = 0.0f, turn_rad = 0.0f;
  bool is_moved() const { return dx_px != 0.0f || dy_px != 0.0f || turn_rad != 0.0f; }
};

struct FrameCorrections {
  std::vector<FrameCorrection> of_frame;  // by index in the manifest
  std::array<float, 3> ghost{};
};

// `frames`, and those of `known` that their corrections need; ascending. `corrections` may be null.
std::vector<int> with_needed(const std::vector<int>& frames, const FrameCorrections* corrections,
                             const std::vector<int>& known);

}  // namespace glasswing
