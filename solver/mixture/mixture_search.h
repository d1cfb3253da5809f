// Finds how many footprints a pixel's channel has, and where they are, from a mixture of patterns of any
// kind.
//
// The neighbours' footprints are tried first: most pixels look where their neighbours do. Otherwise a
// dictionary of footprints all over the monitor, narrow and wide ones, tells by one product with the residual
// which one more would explain most of it (matching pursuit): no peaks, phases or decodes of a kind of
// pattern are needed. From there, from the last fit with a mode split, and from what neighbours have, the fit
// goes to its minimum. One more mode must lower n log chi2 by 4 log n.
#pragma once

#include <span>
#include <vector>

#include "solver/mixture/mixture_fit.h"

namespace glasswing {

// Of one monitor. Thread-safe.
class FootprintDictionary {
 public:
  // Keeps a reference.
  explicit FootprintDictionary(const PatternLanes& patterns);

  // What a channel's weights and peaks make of it.
  struct Norms {
    std::vector<float> sums;     // by footprint: sum_i w a
    std::vector<float> squares;  // sum_i w a^2, less what F takes
  };
  Norms norms(const MixtureLanes& samples) const;

  // The footprint that, added with its best weight, explains most of the residual. Of weight 0 if none does.
  Footprint best(const MixtureLanes& samples, const Residual& residual, const Norms& norms) const;

 private:
  const PatternLanes& patterns_;
  std::vector<Footprint> footprints_;
  size_t stride_ = 0;           // footprints, padded with such as answer to nothing
  std::vector<float> answers_;  // [pattern][footprint], of weight 1
};

class MixtureSearch {
 public:
  // Keeps references. `max_modes`: 1 to 4.
  MixtureSearch(const FootprintDictionary& dictionary, int max_modes)
      : dictionary_(dictionary), max_modes_(max_modes) {}

  // `neighbours`: footprints of pixels or channels nearby. If the likeliest of them lead to a fit that leaves
  // only noise, and fewer would not, it is accepted; otherwise they are additional starts. Modes in order of
  // weight.
  MixtureFit run(const MixtureSamples& samples, std::span<const Footprints> neighbours) const;

  // Whether only noise remains.
  static bool explains(const MixtureFit& fit, int samples);

 private:
  MixtureFit search(const MixtureLanes& samples, const FootprintDictionary::Norms& norms,
                    std::span<const Footprints> neighbours) const;
  // Without the weakest modes, as long as the others explain the samples as well.
  MixtureFit fewest(const MixtureLanes& samples, MixtureFit fit) const;
  MixtureFit best_of(const MixtureLanes& samples, int size, std::span<const Footprints> starts) const;
  // The last fit with the best footprint of its residual.
  Footprints with_best(const MixtureLanes& samples, const FootprintDictionary::Norms& norms,
                       Footprints modes) const;

  const FootprintDictionary& dictionary_;
  const int max_modes_;
};

}  // namespace glasswing
