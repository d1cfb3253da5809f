// Second pass of method gaussian with footprints=any: pixels that no few Gaussians explain get pyramids.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "core/matte/matte.h"
#include "solver/any/pyramid_fit.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"
#include "solver/mixture/mixture_layout.h"

namespace glasswing {

class PyramidSolver {
 public:
  // Keeps references. `fitters`: by monitor of the layout; they keep answers from one tile to the next.
  PyramidSolver(const FrameStack& stack, const MixtureLayout& layout,
                const std::deque<PatternLanes>& patterns, std::vector<PyramidFitter>& fitters);

  // Of a pixel, whose Gaussian modes the matte has: gives channels of the object whose samples they may not
  // explain a pyramid, and takes the flag of poor fits back where all channels are explained. Modes and F
  // stay.
  void refine(int x, int y, Matte& matte);
  // The pyramids that were fitted so far, kept or not.
  std::int64_t fitted() const { return fitted_; }

 private:
  // Whether the pyramid explains what the monitor shows.
  bool refine(size_t monitor, int x, int y, int channel, Matte& matte);

  const FrameStack& stack_;
  const MixtureLayout& layout_;
  const std::deque<PatternLanes>& patterns_;
  std::vector<PyramidFitter>& fitters_;
  SampleNoise noise_;
  std::int64_t fitted_ = 0;
  std::vector<std::vector<Coefficient>> last_;  // by monitor: what this pixel's last channel got
};

}  // namespace glasswing
