// The roles of an archive's frames in method gaussian.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "core/footprint/lit_area.h"
#include "solver/background/stage_layout.h"
#include "solver/background/wave_noise.h"

namespace glasswing {

// One travelling stripe; samples in order of r.
struct SweepLayout {
  int texture = 0;
  double phi_deg = 0.0;
  double cos_phi = 1.0;
  double sin_phi = 0.0;
  double sigma_px = 0.0;
  std::vector<Shot> shots;
  std::vector<double> r_px;                 // ascends strictly
  std::vector<std::array<double, 3>> peak;  // radiance at the peak, per channel
};

// A picture of white or gray, or of bars, with the object.
struct AreaFrames {
  LitArea lit;
  double light = 1.0;  // radiance where it is lit
  Shot shot;
};

struct StackLayout {
  std::vector<SweepLayout> sweeps;             // by texture
  std::vector<std::vector<AreaFrames>> areas;  // by texture; the whole monitor comes first
  StageLayout stage;
  WaveNoise wave_noise;
  bool one_frame_a_shot = true;
};

// FAILED_PRECONDITION says what is missing or does not fit: no black with the object, sweeps in fewer than
// three orientations on a monitor, a sweep of fewer than five steps, invalid numbers.
absl::StatusOr<StackLayout> lay_out(const v1::CaptureManifest& manifest);

// Every frame listed in the layout.
std::vector<int> frames_of(const StackLayout& layout);

}  // namespace glasswing
