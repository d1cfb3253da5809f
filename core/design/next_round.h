// The next round of an adaptive capture: how well each pixel is known so far, and the most informative waves
// about those that are not known well enough.
//
// A pixel's covariance is I^-1 (information.h) for the footprints that a solve found and a noise of `excess`
// times the camera's: the ratio of the solve's own standard error of its best known position to the predicted
// one, which includes noise beyond the camera's and model errors. Each wave, in two phases, is the one that
// lowers
//
//   sum over pixels of log(error^2 + target^2)
//
// most, given all previous ones: with B its two rows of derivatives, I^-1 becomes C - C B'(1 + B C B')^-1 B
// C. A wave gives no information about a pixel whose position is not yet known to an eighth of its period.
//
// Pixels that no few Gaussians explain have the errors of known_shape.h in the same sum.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/design/information.h"

namespace glasswing {

// One channel of a pixel, on one monitor.
struct KnownPixel {
  Footprints modes;  // the strongest first
  // As solved; 0: unknown.
  std::array<double, kMaxFootprints> weight_sd{}, centre_sd_px{};
  CameraNoise noise = {};
  double excess = 1.0;  // over `noise`, by find_excess()
  // No few Gaussians explain it: `modes` tell its place and extent alone, composites' error is that of a
  // shape.
  bool any_shape = false;
};

struct RoundTarget {
  enum class Kind { kComposite, kCentre };
  Kind kind = Kind::kComposite;
  double error = 0.01;  // rms of full scale; px
};

// Standard errors.
struct PixelError {
  double composite = 0.0;  // of full scale
  double centre_px = 0.0;  // of the strongest footprint
  double of(RoundTarget::Kind kind) const {
    return kind == RoundTarget::Kind::kCentre ? centre_px : composite;
  }
};

// Sets `excess` of pixels that were solved from these patterns; of any shape, or if no position is known by
// itself, to the median of the others.
void find_excess(const PatternAnswers& shown, std::span<KnownPixel> pixels);

// In the pixels' order; each must have modes.
std::vector<PixelError> errors_of(const PatternAnswers& shown, std::span<const KnownPixel> pixels);

// Periods to the monitor's longer side, in eight directions from 6 px; for any shape, in 32 from 3 px to four
// times that side (known_shape.h).
std::vector<DesignedWave> usual_waves(const MonitorExtent& extent, bool any_shape = false);

// From `waves`, at least `least` and at most `most`, but no more than needed to bring all but a thirtieth of
// the pixels to the target. Each pixel has modes. A wave that is chosen again gets a slightly longer period.
std::vector<DesignedWave> choose_waves(const PatternAnswers& shown, std::span<const KnownPixel> pixels,
                                       const RoundTarget& target, std::vector<DesignedWave> waves, int least,
                                       int most);

}  // namespace glasswing
