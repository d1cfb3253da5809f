// The roles of an archive's frames in method hierarchical.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <string>
#include <vector>

#include "solver/background/stage_layout.h"
#include "solver/hierarchical/wave_axis.h"

namespace glasswing {

// One picture on a monitor, with the object: bars or a solid.
struct BoxPattern {
  static constexpr int kSolid = -1;
  int axis = kSolid;                           // 0: vertical bars, along x; 1: horizontal bars, along y
  size_t wave = 0;                             // index in BoxMonitor::waves
  double sign = 1.0;                           // -1: the complement
  std::array<double, 3> light{1.0, 1.0, 1.0};  // radiance of lit pixels
  Shot shot;
};

struct BoxMonitor {
  int texture = 0;
  int width_px = 0, height_px = 0;
  std::array<std::vector<BarWave>, 2> waves;  // wide to narrow
  std::vector<BoxPattern> patterns;           // solids first; a wave's complement right after it
};

struct BoxLayout {
  StageLayout stage;
  std::vector<BoxMonitor> monitors;   // those that showed waves, by texture; none of a bare stage
  std::vector<std::string> warnings;  // for users: positions that the waves cannot distinguish
};

// An archive of only the empty stage also has a matte: where each pixel looks (docs/rays.md).
// FAILED_PRECONDITION says what is missing or invalid: waves along one axis only, F and R not separable
// (no complements, neither black and a solid nor four waves along either axis), invalid numbers.
absl::StatusOr<BoxLayout> lay_out_boxes(const v1::CaptureManifest& manifest);

// Every frame listed in the layout.
std::vector<int> frames_of(const BoxLayout& layout);

}  // namespace glasswing
