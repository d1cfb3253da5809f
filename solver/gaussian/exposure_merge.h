// One stimulus's light at one place, from all frames that were taken of it:
//
//   radiance = sum_i w_i s_i y_i / sum_i w_i,    w_i = 1 / (s_i^2 variance(L / s_i))
//
// s_i brings sample y_i to the scale of the reference exposure; L is what the longest exposure says that is
// not saturated. Weights from each sample's own value would favour what noise made darker.
#pragma once

#include <span>

#include "solver/gaussian/silhouette.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method.h"

namespace glasswing {

struct MergedSample {
  double radiance = 0.0;   // on the scale of the reference exposure
  double variance = 0.0;   // expected
  bool saturated = false;  // in every frame; radiance is then the least that it can be
};
// `shot` is not empty; `place` is FrameStack::place().
MergedSample merge(const FrameStack& stack, std::span<const ExposedFrame> shot, size_t place,
                   const SampleNoise& noise);

}  // namespace glasswing
