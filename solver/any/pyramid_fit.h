// Fits any footprint of one channel on one monitor: positive coefficients of the Gaussians of a pyramid
// (Matte::Coefficient), by the likelihood of mixture_fit.h and a prior,
//
//   chi2 = sum_i w_i (y_i - F - sum_k c_k a_ik)^2 + sum_k (c_k / s_k)^2,  c_k >= 0
//
// with a_ik what Gaussian k answers to pattern i (pattern_answer.h). s_k is 4^level s: a Gaussian's part of
// light that lies evenly on the footprint's area. So where samples say nothing, light is spread over wide
// Gaussians and over many of them; a coefficient that no sample pays for is 0. The minimum is unique.
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
  double floor = 0.0;     // F
  double chi2 = 0.0;      // without the prior's part
  double prior_sd = 0.0;  // s
};

// min c'Gc / 2 - b'c over c >= 0, G positive definite, within a thousandth of a sample's chi2: projected
// Newton (Bertsekas 1982).
Eigen::VectorXd positive_minimum(const Eigen::MatrixXd& g, const Eigen::VectorXd& b);

// One thread's.
class PyramidFitter {
 public:
  // Keeps a reference.
  explicit PyramidFitter(const PatternAnswers& answers) : answers_(answers) {}

  // y, weight and peak as in MixtureSamples, black last. `near`: the closest Gaussians, which say where light
  // is and how much. None if there is no light, or if it is wider than a pyramid's coefficients can cover.
  std::optional<PyramidFit> fit(const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                                const Eigen::VectorXd& peak, const Footprints& near);

 private:
  const Eigen::VectorXf& answer(const Coefficient& place);

  const PatternAnswers& answers_;
  std::unordered_map<std::int64_t, Eigen::VectorXf> known_;  // answers, by place
};

}  // namespace glasswing
