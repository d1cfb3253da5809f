// Fits any footprint of one channel on one monitor: positive coefficients of the Gaussians of a pyramid
// (Matte::Coefficient), by the likelihood of mixture_fit.h and a prior,
//
//   chi2 = sum_i w_i (y_i - F - sum_k c_k a_ik)^2 + sum_k (c_k / s_k)^2,  c_k >= 0
//
// with a_ik what Gaussian k answers to pattern i (pattern_answer.h). s_k is 2 4^level times the light
// expected on 4 px^2 there. Patterns of four directions leave shapes open: it is expected evenly on an eighth
// of the footprint's area. Those of more show the modes' places, and it is expected around them: else noise
// fits best with a little light everywhere and less F, as coefficients are positive. So where samples say
// nothing, light is spread over wide Gaussians and over many of them; a coefficient that no sample pays for
// is 0. Noise adds light to dark places, as coefficients are positive: a toll (positive_fit.h) takes as much
// from bright ones. The minimum is unique.
//
// The pixel's modes are columns of the same model, as a thin line is a narrow mode and no pyramid. Place and
// widths of a mode were found from the same n samples, and cost log evidence 5/2 log n: so much does the
// prior take from a mode that keeps its weight,
//
//   s_m = (5 log n)^-1/2 of the mode's weight
//
// Modes alone may still predict better. The fit is the average of both that predicts the samples best, by
// Mallows' criterion (Hansen 2007). Where patterns have few directions, samples often leave open which is
// right: modes alone then get of that share what their evidence (log marginal likelihood) gives them.
// Samples that neither explains have less weight.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/matte/matte.h"
#include "solver/mixture/mixture_fit.h"

namespace glasswing {

struct PyramidFit {
  std::vector<Coefficient> coefficients;
  std::vector<double> modes;  // by mode, how much of its weight
  double floor = 0.0;         // F
  double chi2 = 0.0;          // without the prior's part
  double prior_sd = 0.0;      // of even light, of level 0
  double gaussian = 0.0;      // the share of modes alone in the average
};

// One thread's.
class PyramidFitter {
 public:
  struct Range {
    double low_px, high_px;
  };

  // Keeps a reference.
  explicit PyramidFitter(const PatternLanes& patterns);

  // What Gaussians leave of the samples at the best F.
  double gaussians_chi2(const MixtureLanes& samples, const Footprints& near);

  // `near`: the closest Gaussians, which say where light is and how much. `like`: coefficients of a similar
  // footprint, if one is known; they make it faster. None if there is no light, or if it is wider than a
  // pyramid's coefficients can cover.
  std::optional<PyramidFit> fit(const MixtureLanes& samples, const Footprints& near,
                                const std::vector<Coefficient>& like = {});

 private:
  struct Problem;
  struct Average;
  struct Place {
    Coefficient at;
    const float* answer;
    double prior_sd;
  };
  Problem problem_of(const MixtureLanes& samples, const Footprints& near, const std::vector<Place>& places);
  // Those where the prior and the samples leave room for light.
  std::vector<Place> places_of(const MixtureLanes& samples, const Footprints& near, const Range& across,
                               const Range& down, double prior_sd);
  const std::vector<float>& answer(const Footprint& footprint);
  const float* answer(const Coefficient& place);

  const PatternLanes& patterns_;
  const MonitorExtent extent_;
  bool few_directions_;
  std::vector<double> values_;                                  // of the last answer, by pattern, and
  std::vector<float> answer_;                                   // by lane
  std::unordered_map<std::int64_t, std::vector<float>> known_;  // answers, by place
};

}  // namespace glasswing
