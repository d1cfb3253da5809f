// Which frames of an archive play which part for swept Gaussians.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <map>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// A frame, and what makes a value in it radiance on the scale of the reference exposure.
struct ExposedFrame {
  int frame = 0;       // place in the manifest
  double scale = 1.0;  // reference exposure over this one
};

// All frames of one stimulus: exposures, and takes.
using Shot = std::vector<ExposedFrame>;

// One stripe, travelling; samples in order of r.
struct SweepLayout {
  int texture = 0;
  double phi_deg = 0.0;
  double cos_phi = 1.0;
  double sin_phi = 0.0;
  double sigma_px = 0.0;
  std::vector<Shot> shots;
  std::vector<double> r_px;                 // ascends strictly
  std::vector<std::array<double, 3>> peak;  // radiance on the crest, per channel
};

struct StackLayout {
  std::vector<SweepLayout> sweeps;  // by texture
  Shot black;                       // with the object
  // The same stimulus with and without the object.
  struct Pair {
    Shot object, empty;
  };
  std::vector<Pair> pairs;
  // Frames between which nothing but an id patch changes.
  std::vector<std::vector<int>> patches;
  // Every exposure in use, the reference first: that of the manifest's first pattern.
  std::vector<double> exposures_ms;
  bool one_frame_a_shot = true;
};

// FAILED_PRECONDITION says what is missing or does not fit: no black with the object, sweeps in fewer than
// three orientations on a monitor, a sweep of fewer than five steps, numbers that are none.
absl::StatusOr<StackLayout> lay_out(const v1::CaptureManifest& manifest);

}  // namespace glasswing
