// The minimiser of mixtures and spectra (solver/gaussian/joint_fit has its own, which keeps places within
// pixels moving): Levenberg-Marquardt over (R, c, Sigma) of each footprint, with steps
// that keep Sigma positive (cone_step.h). Of Ceres, TinySolver knows no such bound; through a factor of Sigma
// it stalls at points and lines, where the factor's derivative vanishes.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/footprint/cone_step.h"

namespace glasswing {

// The Gauss-Newton equations matrix * step = gradient at some footprints.
struct FootprintEquations {
  FootprintMatrix matrix;
  FootprintVector gradient;
  double cost = 0.0;
  // A step that promises to lower the cost by no more has converged.
  double enough = 0.0;
};

struct StepLimits {
  int max_steps = 60;
  double little = 0.0;     // of the cost: a fit that gains no more in a step has converged
  double rounding = 1e-9;  // of the cost, by which a step may raise it
};

template <typename Equations>
struct Minimum {
  Footprints modes;
  Equations at;
  bool converged = false;
};

// `evaluate(modes, equations)` sets all of `equations`, which derive from FootprintEquations;
// `is_sane(modes)` says whether they can be evaluated at all. The Sigma of `start` are positive
// semi-definite.
template <typename Equations, typename Evaluate, typename IsSane>
Minimum<Equations> minimise(const Footprints& start, const Evaluate& evaluate, const IsSane& is_sane,
                            const StepLimits& limits) {
  constexpr double kMaxDamping = 1e8, kMinDamping = 1e-7, kUndamped = 0.1;
  Minimum<Equations> best{.modes = start, .at = {}};
  Equations next;
  evaluate(start, best.at);
  double damping = 1e-3;
  for (int i = 0; i < limits.max_steps && !best.converged && damping < kMaxDamping; ++i) {
    const Equations& at = best.at;
    FootprintMatrix damped = at.matrix;
    const double least = 1e-12 * at.matrix.diagonal().maxCoeff();
    damped.diagonal() += damping * at.matrix.diagonal();
    damped.diagonal().array() += least;
    const Eigen::LLT<FootprintMatrix> solver(damped);
    const auto [moved, step] = step_within_cone(best.modes, solver, solver.solve(at.gradient));
    const double promise = 2.0 * at.gradient.dot(step) - step.dot(at.matrix * step);
    const bool last = promise <= at.enough;
    if (solver.info() == Eigen::Success && is_sane(moved)) {
      evaluate(moved, next);
      if (next.cost <= at.cost * (1.0 + limits.rounding)) {
        const double gained = at.cost - next.cost;
        best.converged = (last || gained < limits.little * at.cost) && damping < kUndamped;
        best.modes = moved;
        std::swap(best.at, next);
        // Damping follows the accuracy of the quadratic model.
        damping *= gained > 0.5 * promise ? 0.1 : gained < 0.2 * promise ? 3.0 : 1.0;
        damping = std::max(damping, kMinDamping);
        continue;
      }
    }
    best.converged = last;
    damping = std::max(4.0 * damping, 1e-5);
  }
  for (Footprint& mode : best.modes) mode = with_positive_covariance(mode, 0.0);
  return best;
}

}  // namespace glasswing
