// Fits any footprint of one channel on one monitor: positive coefficients of the Gaussians of a pyramid
// (Matte::Coefficient), by the likelihood of mixture_fit.h and a prior,
//
//   chi2 = sum_i w_i (y_i - F - sum_k c_k a_ik)^2 + sum_k (c_k / s_k)^2,  c_k >= 0
//
// with a_ik what Gaussian k answers to pattern i (pattern_answer.h). s_k is 4^level s: a Gaussian's part of
// light that lies evenly on an eighth of the footprint's area. So where samples say nothing, light is spread
// over wide Gaussians and over many of them; a coefficient that no sample pays for is 0. The minimum is
// unique.
//
// Samples often leave open whether that or the pixel's modes are right. The fit is the average of both by
// their evidence (log marginal likelihood), in one model: the modes, of less weight, beside the coefficients.
#pragma once

#include <Eigen/Dense>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/footprint/pattern_answer.h"
#include "core/matte/matte.h"
#include "solver/mixture/mixture_fit.h"

namespace glasswing {

struct PyramidFit {
  std::vector<Coefficient> coefficients;
  std::vector<double> modes;  // by mode, what is left of its weight
  double floor = 0.0;         // F
  double chi2 = 0.0;          // without the prior's part
  double prior_sd = 0.0;      // s
  double gaussian = 0.0;      // probability that the modes alone explain the samples
};

// min |y - A x|^2 + sum_k (x_k / s_k)^2 over x >= 0, except x_0, which may have any sign, and the `left_out`
// after it, which are 0: by a working set that grows by those coefficients that lower the cost most, and
// projected Newton (Bertsekas 1982) on it.
struct PositiveFit {
  Eigen::VectorXd x;
  double chi2 = 0.0;      // |y - A x|^2
  double evidence = 0.0;  // log marginal likelihood of the coefficients above 0
};
PositiveFit positive_minimum(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::VectorXd& y,
                             const Eigen::Ref<const Eigen::VectorXd>& prior_sd, Eigen::Index left_out = 0);

// One thread's.
class PyramidFitter {
 public:
  struct Range {
    double low_px, high_px;
  };

  // Keeps a reference.
  explicit PyramidFitter(const PatternAnswers& answers) : answers_(answers) {}

  // y, weight and peak as in MixtureSamples, black last. `near`: the closest Gaussians, which say where light
  // is and how much. None if there is no light, or if it is wider than a pyramid's coefficients can cover.
  std::optional<PyramidFit> fit(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                const Eigen::VectorXd& peak, const Footprints& near);

 private:
  struct Problem;
  Problem problem_of(const Eigen::VectorXd& y, const Eigen::VectorXd& weight, const Eigen::VectorXd& peak,
                     const Footprints& near, const std::vector<Coefficient>& places, double prior_sd);
  // Those where samples leave room for light.
  std::vector<Coefficient> places_of(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                     const Eigen::VectorXd& peak, const Range& across, const Range& down,
                                     double prior_sd);
  const Eigen::VectorXf& answer(const Coefficient& place);

  const PatternAnswers& answers_;
  std::unordered_map<std::int64_t, Eigen::VectorXf> known_;  // answers, by place
};

}  // namespace glasswing
