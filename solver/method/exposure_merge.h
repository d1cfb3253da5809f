// The light of one stimulus in one sample, merged from all its frames:
//
//   radiance = sum_i w_i s_i y_i / sum_i w_i,    w_i = 1 / (s_i^2 variance(L / s_i))
//
// s_i scales sample y_i to the reference exposure; L is the light of the longest unsaturated exposure.
// Weights from each sample's own value would favour samples that noise made darker.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <vector>

#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

// Whether all monitors were black.
bool is_black(const v1::Frame& frame);

// Whether methods solve from this frame: a pattern on one monitor, not a reference.
bool is_pattern(const v1::Frame& frame);

// A frame and the factor from its values to radiance at the reference exposure.
struct ExposedFrame {
  int frame = 0;       // index in the manifest
  double scale = 1.0;  // reference exposure over this one
};

// All frames of one stimulus: its exposures and repeats.
using Shot = std::vector<ExposedFrame>;

// The exposures of all patterns of a manifest.
class Exposures {
 public:
  // FAILED_PRECONDITION: an exposure is not a number, or is 0 although exposures differ.
  static absl::StatusOr<Exposures> of(const v1::CaptureManifest& manifest);

  ExposedFrame exposed(const v1::CaptureManifest& manifest, int frame) const;
  // The reference exposure, that of the manifest's first pattern, comes first.
  const std::vector<double>& times_ms() const { return times_ms_; }

 private:
  std::vector<double> times_ms_;
};

struct MergedSample {
  double radiance = 0.0;   // on the scale of the reference exposure
  double variance = 0.0;   // expected
  bool saturated = false;  // in every frame; radiance is then a lower bound
};
// `shot` is not empty; `index` is FrameStack::sample_index().
MergedSample merge(const FrameStack& stack, std::span<const ExposedFrame> shot, size_t index,
                   const SampleNoise& noise);

}  // namespace glasswing
