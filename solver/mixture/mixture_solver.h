// Solves rows of a stack from a mixture of patterns.
#pragma once

#include <deque>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/mixture/mixture_layout.h"
#include "solver/mixture/mixture_search.h"

namespace glasswing {

// Data that depends only on the layout. Thread-safe.
struct MixtureTables {
  explicit MixtureTables(const MixtureLayout& layout);

  // By monitor of the layout; each refers to the one before.
  std::deque<PatternAnswers> answers;
  std::deque<PatternLanes> patterns;
  std::deque<FootprintDictionary> dictionaries;
};

class MixtureSolver {
 public:
  // Keeps references. `max_modes`: of a channel on one monitor.
  MixtureSolver(const FrameStack& stack, const MixtureLayout& layout, const MixtureTables& tables,
                int max_modes, double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // Standard deviation of a row's samples, if neither the camera's noise is known nor bars have complements:
  // from the quarter of them with the smallest differences between the stage with and without the object.
  double noise_of_pairs(int y) const;
  // The same, from the residuals of fits of some of the row's pixels. Where a row is all object, differences
  // from the empty stage are not noise.
  double noise_of_fits(int y);
  // chi2 of a degree of freedom.
  double noise_left(const MixtureFit& fit) const;
  void load(size_t monitor, int x, int y, int channel);
  // Replaces samples that the camera clipped at black by their expected values, and weights white and bars by
  // their possible errors.
  void reweigh(size_t monitor, const Footprints& modes, double floor);
  MixtureFit solve(size_t monitor, std::span<const Footprints> neighbours);
  void solve_channel(int x, int y, int channel, Matte& matte);

  const FrameStack& stack_;
  const MixtureLayout& layout_;
  const MixtureTables& tables_;
  const int max_modes_;
  Surroundings surroundings_;
  SampleNoise noise_;                    // of this row, if the camera's is unknown
  std::vector<MixtureSearch> searches_;  // by monitor of the layout
  MixtureSamples samples_;
  Eigen::VectorXd seen_, variance_;  // as recorded
  bool saturated_ = false, clipped_ = false;
  // The footprints last found, by monitor and channel; forgotten where the object ends.
  std::vector<std::array<Footprints, kChannels>> last_;
};

}  // namespace glasswing
