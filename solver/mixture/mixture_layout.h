// An archive's patterns with the object, of any kind and in any mixture, by monitor.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "core/footprint/pattern_answer.h"
#include "solver/background/stage_layout.h"
#include "solver/background/wave_noise.h"

namespace glasswing {

// What one monitor showed while the others were black. Samples of one sinusoid are adjacent.
struct MixtureMonitor {
  int texture = 0;
  MonitorExtent extent;
  std::vector<ShownPattern> patterns;        // of peak 1
  std::vector<std::array<double, 3>> peaks;  // radiance at the peak, by pattern and channel
  std::vector<Shot> shots;                   // by pattern
};

struct MixtureLayout {
  std::vector<MixtureMonitor> monitors;  // by texture; only those that showed stripes or sinusoids
  StageLayout stage;                     // black is among its frames
  WaveNoise wave_noise;
};

// FAILED_PRECONDITION says what is missing or does not fit: no black with the object, patterns of a monitor
// that vary in fewer than three directions, fewer than kMinPatterns of them, invalid numbers.
absl::StatusOr<MixtureLayout> lay_out_mixture(const v1::CaptureManifest& manifest);

inline constexpr int kMinPatterns = 12;  // stripes and sinusoids on a monitor

// Writes what was shown to the matte's header, for the errors of composites; nothing if patterns have a
// colour, as the header knows only light.
void name_samples(const MixtureLayout& layout, v1::MatteMetadata& metadata);

// Every frame listed in the layout.
std::vector<int> frames_of(const MixtureLayout& layout);

}  // namespace glasswing
