// The one minimiser of footprints: Levenberg-Marquardt over (R, c, Sigma) of each, with steps that keep Sigma
// positive (cone_step.h). Ceres' TinySolver has no such bound; with a factor of Sigma it stalls at points and
// lines, where the factor's derivative vanishes.
#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "core/footprint/cone_step.h"

namespace glasswing {

// The Gauss-Newton equations matrix * step = gradient at some footprints.
struct FootprintEquations {
  FootprintMatrix matrix;  // both triangles
  FootprintVector gradient;
  double cost = 0.0;
  double enough = 0.0;      // a step that promises to lower the cost by no more has converged,
  double little = 0.0;      // and one that did lower it by less
  double rounding = 1e-9;   // of the cost, by which a step may raise it
  FootprintVector least{};  // of the diagonal, for damping; empty: none
};

struct StepLimits {
  int max_steps = 60;
  // The start lies near its minimum: after a rejected step, a parabola determines how much shorter the next
  // must be. A line search would jump over minima.
  bool near = false;
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
  constexpr double kMaxDamping = 1e8, kMinDamping = 1e-7, kUndamped = 0.1, kRise = 4.0, kNothing = 0.1,
                   kShortest = 0.3;
  Minimum<Equations> best{.modes = start, .at = {}};
  double damping = 1e-3;
  std::array<Equations, 2> both;
  Equations *at = &both[0], *next = &both[1];
  evaluate(start, *at);
  for (int i = 0; i < limits.max_steps && !best.converged && damping < kMaxDamping; ++i) {
    FootprintMatrix damped = at->matrix;
    if (at->least.size() > 0) damped.diagonal() = damped.diagonal().cwiseMax(at->least);
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-12 * at->matrix.diagonal().maxCoeff();
    const FootprintCholesky factor(damped);
    const auto [moved, step] = step_within_cone(best.modes, factor, factor.solve(at->gradient));
    const double promise = 2.0 * at->gradient.dot(step) - step.dot(at->matrix * step);
    const bool last = promise <= at->enough;
    // A thirtieth of a standard error is not worth an evaluation.
    if (promise <= kNothing * at->enough && damping < kUndamped) {
      best.converged = true;
      break;
    }
    const bool possible = factor.positive() && is_sane(moved);
    if (possible) {
      evaluate(moved, *next);
      if (next->cost <= at->cost * (1.0 + at->rounding)) {
        const double gained = at->cost - next->cost;
        best.converged = (last || gained < at->little) && damping < kUndamped;
        best.modes = moved;
        std::swap(at, next);
        // Damping follows the accuracy of the quadratic model.
        damping *= gained > 0.9 * promise   ? 0.1
                   : gained > 0.5 * promise ? 0.5
                   : gained < 0.2 * promise ? 3.0
                                            : 1.0;
        damping = std::max(damping, kMinDamping);
        continue;
      }
    }
    best.converged = last;
    damping = std::max(kRise * damping, 1e-5);
    if (limits.near && possible) {
      const double slope = at->gradient.dot(step),
                   shorter = std::max(slope / (next->cost - at->cost + 2.0 * slope), kShortest);
      damping = std::max(damping, (1.0 + damping) / shorter - 1.0);
    }
  }
  for (Footprint& mode : best.modes) mode = with_positive_covariance(mode, 0.0);
  best.at = std::move(*at);
  return best;
}

}  // namespace glasswing
