// Finds how many footprints a pixel's channel has, and where they lie, from a mixture of patterns of any
// kind.
//
// A dictionary of footprints all over the monitor, narrow and wide ones, tells by one product with the
// residual which one more would explain most of it (matching pursuit): no peaks, phases or decodes of a kind
// of pattern are needed. From there, from the last fit with a mode split, and from what a neighbour has, the
// fit goes to its minimum. One more mode must lower n log chi2 by 4 log n.
#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "solver/mixture/mixture_fit.h"

namespace glasswing {

// Of one monitor. Thread-safe.
class FootprintDictionary {
 public:
  explicit FootprintDictionary(const PatternAnswers& answers);

  // What a channel's weights and peaks make of it: computed once for all channels that share them.
  struct Norms {
    Eigen::VectorXf weight, peak;
    Eigen::VectorXf squares;  // by footprint: sum_i w a^2, less what F takes
    Eigen::VectorXf sums;     // sum_i w a
  };
  void weigh(const MixtureSamples& samples, Norms& norms) const;

  // The footprint that, added with its best weight, explains most of the residual, whose weighted sum is 0.
  // Of weight 0 if none does.
  Footprint best(const MixtureSamples& samples, const Eigen::VectorXd& residual, const Norms& norms) const;

 private:
  std::vector<Footprint> footprints_;
  Eigen::MatrixXf answers_;  // a column a footprint, of weight 1; a row a sample
};

class MixtureSearch {
 public:
  // Keeps references. `max_modes`: 1 to 4.
  MixtureSearch(const FootprintDictionary& dictionary, int max_modes)
      : dictionary_(dictionary), max_modes_(max_modes) {}

  // `neighbours`: footprints of pixels or channels nearby, as further starts. Modes in order of weight.
  MixtureFit run(const MixtureSamples& samples, std::span<const Footprints> neighbours);

  // Whether nothing but noise is left.
  static bool explains(const MixtureFit& fit, Eigen::Index samples);

  MixtureWorkspace& workspace() { return workspace_; }

 private:
  MixtureFit best_of(const MixtureSamples& samples, int size, std::span<const Footprints> starts);
  // The last fit with the best footprint of its residual; without a last fit, as many of these as wanted.
  Footprints with_best(const MixtureSamples& samples, Footprints modes);
  void add_splits(const Footprints& modes, std::vector<Footprints>& starts);

  const FootprintDictionary& dictionary_;
  const int max_modes_;
  FootprintDictionary::Norms norms_;
  MixtureWorkspace workspace_;
};

}  // namespace glasswing
