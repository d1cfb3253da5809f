#include "solver/gaussian/joint_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/footprint/cone_step.h"
#include "core/footprint/within_pixel.h"

namespace glasswing {
namespace {

// A hundredth of a pixel wide: effectively a point.
constexpr double kMinCovariance_px2 = 1e-4;

bool sane(const Footprints& modes, const SampleLayout& layout, const MonitorExtent& extent) {
  const double limit = 2.0 * (extent.width_px + extent.height_px);
  for (const Footprint& mode : modes) {
    if (!std::isfinite(mode.weight + mode.x_px + mode.y_px + mode.xx_px2 + mode.xy_px2 + mode.yy_px2))
      return false;
    if (std::abs(mode.x_px) > limit || std::abs(mode.y_px) > limit) return false;
    if (mode.xx_px2 + mode.yy_px2 > limit * limit) return false;
    for (const SampleLayout::Sweep& sweep : layout.sweeps) {
      const double least = 0.25 * sweep.axis.sigma_px * sweep.axis.sigma_px;
      if (answered_variance(mode, sweep.axis) < least) return false;
    }
  }
  return true;
}

FootprintMatrix matrix_of(const NormalEquations& at, Eigen::Index n, unsigned held) {
  FootprintMatrix normal(n, n);
  for (Eigen::Index p = 0; p < n; ++p) {
    for (Eigen::Index q = 0; q < n; ++q) {
      const bool free = ((held >> p | held >> q) & 1u) == 0;
      normal(q, p) = free ? at.matrix[static_cast<size_t>(p)][static_cast<size_t>(q)] : p == q ? 1.0 : 0.0;
    }
  }
  return normal;
}

class Problem {
 public:
  Problem(const PixelSamples& samples, const MonitorExtent& extent, unsigned held, JointWorkspace& workspace)
      : samples_(samples), extent_(extent), held_(held), workspace_(workspace) {}

  // Levenberg-Marquardt; true if it converged.
  bool minimise(Footprints& modes, NormalEquations& at, int max_iterations) {
    const int n = 6 * modes.size();
    double damping = 1e-3;
    FootprintMatrix normal(n, n);
    FootprintVector gradient(n);
    evaluate(samples_, modes, extent_, workspace_, at);
    load(at, normal, gradient);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      FootprintMatrix damped = normal;
      const double floor = 1e-12 * normal.diagonal().maxCoeff();
      damped.diagonal() = (1.0 + damping) * normal.diagonal().cwiseMax(least_of(modes, normal)) +
                          FootprintVector::Constant(n, floor);
      const Eigen::LLT<FootprintMatrix> solver(damped);
      const auto [moved, step] = step_within_cone(modes, solver, solver.solve(gradient));
      // The predicted reduction relative to the noise of one sample: a squared distance in standard errors.
      const double promise = 2.0 * gradient.dot(step) - step.dot(normal * step);
      const double samples = std::max(at.near_count, 1);
      const bool last = promise <= std::max(0.01 * at.near_chi2 / samples, samples * kMinStep * kMinStep);
      bool better = solver.info() == Eigen::Success && sane(moved, *samples_.layout, extent_);
      if (better) {
        evaluate(samples_, moved, extent_, workspace_, next_);
        better = next_.chi2 <= at.chi2 * (1.0 + 1e-7);
      }
      if (better) {
        const double gained = at.chi2 - next_.chi2;
        modes = moved;
        std::swap(at, next_);
        if ((last || gained < 3e-4 * at.near_chi2) && damping < 0.1) return true;
        // Damping follows the accuracy of the quadratic model.
        damping *= gained > 0.9 * promise   ? 0.1
                   : gained > 0.5 * promise ? 0.5
                   : gained < 0.2 * promise ? 3.0
                                            : 1.0;
        damping = std::max(damping, 1e-7);
        load(at, normal, gradient);
      } else {
        if (last) return true;
        damping = std::max(4.0 * damping, 1e-5);
        if (damping > 1e9) return false;
      }
    }
    return false;
  }

 private:
  // Of the diagonal. Within a pixel the derivatives by place and width vanish: each counts as if it moved
  // what stripes see by a tenth of itself. A peak's squares sum to R^2 N_RR; its derivative by the centre has
  // half of that over sigma_r^2, by sigma_r^2 three sixteenths over its square, half of it along either axis.
  FootprintVector least_of(const Footprints& modes, const FootprintMatrix& normal) const {
    constexpr double kShare = 0.01, kCentre = 0.25, kSpread = 3.0 / 32.0;
    double sigma_px = INFINITY;
    for (const SampleLayout::Sweep& sweep : samples_.layout->sweeps)
      sigma_px = std::min(sigma_px, sweep.axis.sigma_px);
    FootprintVector least = FootprintVector::Zero(normal.rows());
    for (int m = 0; m < modes.size(); ++m) {
      if (modes[m].xx_px2 > kHidden_px2 && modes[m].yy_px2 > kHidden_px2) continue;
      const double squares = modes[m].weight * modes[m].weight * normal(6 * m, 6 * m),
                   per_px2 = kShare * squares / (sigma_px * sigma_px);
      least.segment<2>(6 * m + 1).setConstant(kCentre * per_px2);
      least.segment<3>(6 * m + 3).setConstant(kSpread * per_px2 / (sigma_px * sigma_px));
    }
    return least;
  }

  void load(const NormalEquations& at, FootprintMatrix& normal, FootprintVector& gradient) const {
    normal = matrix_of(at, gradient.size(), held_);
    for (Eigen::Index p = 0; p < gradient.size(); ++p)
      gradient[p] = (held_ >> p & 1u) == 0 ? at.gradient[static_cast<size_t>(p)] : 0.0;
  }

  const PixelSamples& samples_;
  const MonitorExtent& extent_;
  const unsigned held_;
  JointWorkspace& workspace_;
  NormalEquations next_;
};

void add_errors(const NormalEquations& at, unsigned held, JointFit& fit) {
  const int n = 6 * fit.modes.size();
  FootprintMatrix normal = matrix_of(at, n, held);
  const double variance = at.near_chi2 / std::max(at.near_count - n, 1);
  const double unit = std::max(variance, kMinStep * kMinStep);
  for (int m = 0; m < fit.modes.size(); ++m) {
    const std::array<double, 5> known = known_within_pixel(fit.modes[m]);
    for (int i = 0; i < 5; ++i) normal(6 * m + 1 + i, 6 * m + 1 + i) += unit * known[static_cast<size_t>(i)];
  }
  fit.weight_sd.fill(std::numeric_limits<double>::infinity());
  fit.centre_sd_px.fill(std::numeric_limits<double>::infinity());
  fit.light_sd = std::numeric_limits<double>::infinity();
  const Eigen::LLT<FootprintMatrix> solver(normal);
  if (solver.info() != Eigen::Success) return;
  FootprintMatrix covariance = solver.solve(FootprintMatrix::Identity(n, n));
  for (int p = 0; p < n; ++p) {
    if ((held >> p & 1u) != 0) covariance(p, p) = 0.0;
  }
  const auto sd = [&](double v) {
    return v >= 0.0 ? std::sqrt(v * variance) : std::numeric_limits<double>::infinity();
  };
  double light = 0.0;
  for (int m = 0; m < n; m += 6) {
    for (int k = 0; k < n; k += 6) light += covariance(m, k);
  }
  fit.light_sd = sd(light);
  for (int m = 0; m < fit.modes.size(); ++m) {
    fit.weight_sd[static_cast<size_t>(m)] = sd(covariance(6 * m, 6 * m));
    fit.centre_sd_px[static_cast<size_t>(m)] =
        sd(0.5 * (covariance(6 * m + 1, 6 * m + 1) + covariance(6 * m + 2, 6 * m + 2)));
  }
}

}  // namespace

void SampleLayout::add(const StripeAxis& axis, const std::vector<double>& r_px) {
  Sweep sweep{.axis = axis,
              .first_r_px = r_px.front(),
              .first = padded_count(),
              .count = static_cast<int>(r_px.size()),
              .padded_count = (static_cast<int>(r_px.size()) + kPad - 1) / kPad * kPad};
  for (const double r : r_px) offset_px.push_back(static_cast<float>(r - sweep.first_r_px));
  offset_px.resize(static_cast<size_t>(sweep.first + sweep.padded_count), offset_px.back());
  sweeps.push_back(sweep);
}

JointFit fit_jointly(const PixelSamples& samples, const Footprints& start, const MonitorExtent& extent,
                     int max_iterations, JointWorkspace& workspace, unsigned held) {
  Problem problem(samples, extent, held, workspace);
  NormalEquations at;
  JointFit fit{.modes = start};
  fit.converged = problem.minimise(fit.modes, at, max_iterations);
  for (Footprint& mode : fit.modes) mode = with_positive_covariance(mode, kMinCovariance_px2);
  fit.chi2 = at.chi2;
  fit.near_chi2 = at.near_chi2;
  fit.near_neighbours = at.near_neighbours;
  fit.near_count = at.near_count;
  fit.floor = at.floor;
  add_errors(at, held, fit);
  return fit;
}

}  // namespace glasswing
