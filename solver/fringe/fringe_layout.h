// The roles of an archive's frames in method fringe.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "core/footprint/footprint.h"
#include "solver/background/stage_layout.h"

namespace glasswing {

// One sinusoid at several phases.
struct Wave {
  double fx = 0.0, fy = 0.0;                  // frequency along x and y, cycles per monitor px
  std::array<double, 3> peak{1.0, 1.0, 1.0};  // maximum radiance, per channel
  std::vector<double> phase_rad;
  std::vector<Shot> shots;  // by phase
};

// Bars along an axis, which distinguish one period of a wave from another: lit from offset_px, bar_px wide,
// with gaps of the same width.
struct Bars {
  double bar_px = 0.0, offset_px = 0.0;
  std::array<double, 3> light{};  // radiance of lit bars, per channel
  Shot lit, complement;           // either may be empty
  // The distance from the nearest edge of a bar, px; positive: lit.
  double inside_px(double at_px) const;
};

// A gray or coloured solid other than black.
struct Solid {
  std::array<double, 3> light{};  // radiance, per channel
  Shot shot;
};

// The patterns of one monitor.
struct WaveMonitor {
  int texture = 0;
  MonitorExtent extent;
  // Waves along x or y first, coarse to fine; then oblique ones, coarse to fine.
  std::vector<Wave> waves;
  std::vector<Solid> solids{};
  std::array<std::vector<Bars>, 2> bars{};  // along x, along y
};

struct FringeLayout {
  std::vector<WaveMonitor> object;  // by texture; only monitors that showed waves
  std::vector<WaveMonitor> empty;   // the same without the object; empty if no monitor showed enough
  Shot empty_black;
  StageLayout stage;
};

// FAILED_PRECONDITION says what is missing or invalid: no sinusoids with the object, a sinusoid at fewer than
// three phases, a monitor without one along x and one along y as long as its side, or whose periods are
// distinguished by square waves or finer sinusoids, or invalid numbers.
absl::StatusOr<FringeLayout> lay_out_fringes(const v1::CaptureManifest& manifest);

// Every frame listed in the layout.
std::vector<int> frames_of(const FringeLayout& layout);

}  // namespace glasswing
