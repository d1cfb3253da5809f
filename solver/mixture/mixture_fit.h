// Fits the footprints of one pixel's channel to all samples of a mixture of patterns, by one likelihood:
//
//   chi2 = sum_i w_i (y_i - F - sum_m y_m(pattern i))^2 + sum_m max(R_m - 1, 0)^2 / 0.02^2
//
// with y_m of pattern_answer.h and w_i the inverse of a sample's variance. Black is a sample like any other.
// The minimum over F is taken at every step. No object emits more light than it receives, so weights above 1
// are penalised.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "core/footprint/cone_step.h"
#include "solver/mixture/pattern_lanes.h"

namespace glasswing {

// The samples of one channel on one monitor, by pattern; the last is black, to which no footprint responds.
struct MixtureSamples {
  const PatternLanes* patterns = nullptr;
  Eigen::VectorXd y, weight;
  Eigen::VectorXd peak;  // of the pattern, in this channel

  Eigen::Index size() const { return y.size(); }
};

// The same in lanes of float (pattern_lanes.h).
struct MixtureLanes {
  explicit MixtureLanes(const MixtureSamples& samples);

  const PatternLanes* patterns;
  int count;                         // with black
  double information;                // sum of the weights
  std::vector<float> y, root, peak;  // y and peak times the weight's root; the root
};

struct MixtureFit {
  Footprints modes;
  double chi2 = 0.0;
  double floor = 0.0;  // F
  bool converged = false;
  std::array<double, kMaxFootprints> weight_sd{}, centre_sd_px{};  // standard errors, by find_errors()
};

// y - F - model, times the root of the weight.
struct Residual {
  std::vector<float> lanes;
  double floor = 0.0;  // F
  double chi2 = 0.0;   // without the bound's part
};
Residual residual_of(const MixtureLanes& samples, const Footprints& modes, bool through_pixels);

// sum_m y_m by pattern, black included.
std::vector<double> model_of(const MixtureSamples& samples, const Footprints& modes, bool through_pixels);

// Levenberg-Marquardt from `start`; Sigma stays positive semi-definite (minimise.h). Converged if a step is
// predicted to lower chi2 by no more than `enough` of one sample's residual, or of its noise.
MixtureFit fit_mixture(const MixtureLanes& samples, const Footprints& start, bool through_pixels,
                       int max_steps, double enough = 0.01);

// Sets the standard errors, from the inverse of the normal matrix; infinite where that is singular.
void find_errors(const MixtureLanes& samples, MixtureFit& fit);

}  // namespace glasswing
