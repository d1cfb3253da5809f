// Second pass of method gaussian with footprints=any: pixels that no few Gaussians explain get pyramids.
#pragma once

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
                const std::deque<PatternAnswers>& answers, std::vector<PyramidFitter>& fitters);

  // Of row y, whose Gaussian modes the matte has: gives channels of the object whose samples they may not
  // explain a pyramid, and takes the flag of poor fits back where all channels are explained. Modes and F
  // stay.
  void refine_row(int y, Matte& matte);

 private:
  // Whether the pyramid explains what the monitor shows.
  bool refine(size_t monitor, int x, int y, int channel, Matte& matte);

  double gaussians_chi2(size_t monitor, const Footprints& modes, const Eigen::VectorXd& seen,
                        const Eigen::VectorXd& weight, const Eigen::VectorXd& peak) const;

  const FrameStack& stack_;
  const MixtureLayout& layout_;
  const std::deque<PatternAnswers>& answers_;
  std::vector<PyramidFitter>& fitters_;
  SampleNoise noise_;
};

}  // namespace glasswing
