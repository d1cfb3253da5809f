// Which frames of an archive play which part for fringes.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "solver/background/stage_layout.h"
#include "solver/footprint/footprint.h"

namespace glasswing {

// One sinusoid, shown at several phases.
struct Wave {
  double fx = 0.0, fy = 0.0;                  // its frequency along x and y, cycles a monitor px
  std::array<double, 3> peak{1.0, 1.0, 1.0};  // radiance where it is brightest, per channel
  std::vector<double> phase_rad;
  std::vector<Shot> shots;  // by phase
};

// A gray or coloured solid that is not black.
struct Solid {
  std::array<double, 3> light{};  // radiance, per channel
  Shot shot;
};

// What one monitor showed.
struct WaveMonitor {
  int texture = 0;
  MonitorExtent extent;
  // Those along x or along y first, coarse to fine; then the oblique ones, coarse to fine.
  std::vector<Wave> waves;
  std::vector<Solid> solids;
};

struct FringeLayout {
  std::vector<WaveMonitor> object;  // by texture; only those that showed waves
  std::vector<WaveMonitor> empty;   // the same without the object; none if no monitor showed enough
  Shot empty_black;
  StageLayout stage;
};

// FAILED_PRECONDITION says what is missing or does not fit: no sinusoids with the object, a sinusoid at fewer
// than three phases, a monitor without one along x and one along y that are as long as its side, or numbers
// that are none.
absl::StatusOr<FringeLayout> lay_out_fringes(const v1::CaptureManifest& manifest);

// Every frame that the layout names.
std::vector<int> frames_of(const FringeLayout& layout, const v1::CaptureManifest& manifest);

}  // namespace glasswing
