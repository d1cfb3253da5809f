// One stimulus's light at one place, from all frames that were taken of it:
//
//   radiance = sum_i w_i s_i y_i / sum_i w_i,    w_i = 1 / (s_i^2 variance(L / s_i))
//
// s_i brings sample y_i to the scale of the reference exposure; L is what the longest exposure says that is
// not saturated. Weights from each sample's own value would favour what noise made darker.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <vector>

#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

// Whether a method may solve from a frame: a pattern on one monitor, and no reference.
bool is_pattern(const v1::Frame& frame);

// A frame, and what makes a value in it radiance on the scale of the reference exposure.
struct ExposedFrame {
  int frame = 0;       // place in the manifest
  double scale = 1.0;  // reference exposure over this one
};

// All frames of one stimulus: exposures, and takes.
using Shot = std::vector<ExposedFrame>;

// The exposures of all patterns of a manifest.
class Exposures {
 public:
  // FAILED_PRECONDITION: one is no number, or is 0 where they differ.
  static absl::StatusOr<Exposures> of(const v1::CaptureManifest& manifest);

  ExposedFrame exposed(const v1::CaptureManifest& manifest, int frame) const;
  // The reference first: that of the manifest's first pattern.
  const std::vector<double>& times_ms() const { return times_ms_; }

 private:
  std::vector<double> times_ms_;
};

struct MergedSample {
  double radiance = 0.0;   // on the scale of the reference exposure
  double variance = 0.0;   // expected
  bool saturated = false;  // in every frame; radiance is then the least that it can be
};
// `shot` is not empty; `place` is FrameStack::place().
MergedSample merge(const FrameStack& stack, std::span<const ExposedFrame> shot, size_t place,
                   const SampleNoise& noise);

}  // namespace glasswing
