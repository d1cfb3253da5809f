// Which frames of an archive play which part for swept Gaussians.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// One stripe, travelling; samples in order of r.
struct SweepLayout {
  int texture = 0;
  double phi_deg = 0.0;
  double cos_phi = 1.0;
  double sin_phi = 0.0;
  double sigma_px = 0.0;
  std::vector<int> frames;  // places in the manifest
  std::vector<double> r_px;
  std::vector<std::array<double, 3>> peak;  // radiance on the crest, per channel
};

struct StackLayout {
  std::vector<SweepLayout> sweeps;
  int black = -1;        // with the object
  int empty_black = -1;  // without; -1: there is none
  int empty_white = -1;
  // The same stimulus with and without the object.
  struct Pair {
    int object, empty;
  };
  std::vector<Pair> pairs;
};

// FAILED_PRECONDITION says what is missing or does not fit: no black with the object, sweeps in fewer than
// three orientations on a monitor, a sweep of fewer than five steps, several exposures.
absl::StatusOr<StackLayout> lay_out(const v1::CaptureManifest& manifest);

}  // namespace glasswing
