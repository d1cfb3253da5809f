// What patterns have told about pixels of any shape, and what further waves would. Pixels of about the same
// extent, light and noise know the same (shape_posterior.h). A pixel's error of composites is
//
//   contrast^2 mean_f (Var Re H(f) + Var Im H(f))
//
// over the candidates' frequencies, which stand for every octave and direction of the background. Pictures
// continue beyond the monitor: two octaves longer than its side stand for their means, which differ by half
// of their contrast. Waves of these periods tell H(0) from F, which many waves of short ones, whose noise is
// fitted by positive coefficients, make too dark.
//
// n waves of one frequency, their phases spread evenly, tell as much as n / 2 in two phases. A sweep of N
// stripes d px apart tells H at multiples of 1 / N d in its direction, each part with the variance
// N d^2 v / 2 s(f)^2, where s is the stripe's spectrum and v a sample's variance. White and bars are not
// counted.
#pragma once

#include <compare>
#include <span>
#include <vector>

#include "core/design/information.h"
#include "core/design/shape_posterior.h"
#include "core/design/wave_ladder.h"
#include "core/footprint/pattern_answer.h"

namespace glasswing {

struct SeenFrequency {
  Frequency at;
  double variance = kWaveVariance;  // of each part, where a sample's is 1
};
std::vector<SeenFrequency> seen_frequencies(std::span<const ShownPattern> patterns);

// In half octaves.
struct ShapeKind {
  int extent = 0;  // of rho, px
  int light = 0;
  int noise = 0;  // standard deviation of a sample
  auto operator<=>(const ShapeKind&) const = default;
};
ShapeKind shape_kind(const Footprints& modes, double noise_sd);

class KnownShape {
 public:
  // `waves`: the candidates.
  KnownShape(const ShapeKind& kind, std::span<const SeenFrequency> seen, std::span<const DesignedWave> waves);

  double square() const;           // of the error of composites
  Eigen::ArrayXd lowered() const;  // the same, by candidate: if it were shown in two phases
  void show(Eigen::Index wave);

 private:
  Eigen::Index count_;
  double variance_;  // of each part, from a wave
  double each_;      // of a frequency's variance in square()
  std::vector<ShapePosterior> parts_;
};

}  // namespace glasswing
