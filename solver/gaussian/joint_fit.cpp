#include "solver/gaussian/joint_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace glasswing {
namespace {

using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostParameters, 1>;
// A hundredth of a pixel wide: a point, to all that follows.
constexpr double kLeastCovariance_px2 = 1e-4;
constexpr double kFinestStep = 1.0 / 65535.0;  // of the frames; a fit that moves by less is settled

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostParameters, kMostParameters>;

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

// The positive semi-definite (xx, xy, yy) nearest to `target` in the metric H: rank one, found along its
// direction.
Eigen::Vector3d nearest_positive(const Eigen::Vector3d& target, const Eigen::Matrix3d& metric) {
  const auto at = [&](double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Eigen::Vector3d(c * c, c * s, s * s);
  };
  const auto gain = [&](double angle) {
    const Eigen::Vector3d a = at(angle);
    const double along = std::max(a.dot(metric * target), 0.0);
    return along * along / a.dot(metric * a);
  };
  constexpr int kDirections = 12;
  double best = 0.0, best_gain = -1.0;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = i * std::numbers::pi / kDirections;
    if (const double g = gain(angle); g > best_gain) best = angle, best_gain = g;
  }
  for (double width = 0.5 * std::numbers::pi / kDirections; width > 1e-4; width *= 0.5) {
    for (const double angle : {best - width, best + width}) {
      if (const double g = gain(angle); g > best_gain) best = angle, best_gain = g;
    }
  }
  const Eigen::Vector3d a = at(best);
  return std::max(a.dot(metric * target), 0.0) / a.dot(metric * a) * a;
}

class Problem {
 public:
  Problem(const PixelSamples& samples, const MonitorExtent& extent, JointWorkspace& workspace)
      : samples_(samples), extent_(extent), workspace_(workspace) {}

  // Levenberg-Marquardt; true if it settled.
  bool minimise(Footprints& modes, NormalEquations& at, int max_iterations) {
    const int n = 6 * modes.size();
    double damping = 1e-3;
    Matrix normal(n, n);
    Vector gradient(n);
    evaluate(samples_, modes, extent_, workspace_, at);
    load(at, normal, gradient);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      Matrix damped = normal;
      const double floor = 1e-12 * normal.diagonal().maxCoeff();
      damped.diagonal() += damping * normal.diagonal() + Vector::Constant(n, floor);
      const Eigen::LLT<Matrix> solver(damped);
      Vector step = solver.solve(gradient);
      const Footprints moved = constrained(modes, solver, step);
      // What the step promises, against the noise of one sample: a squared distance in standard errors.
      const double promise = 2.0 * gradient.dot(step) - step.dot(normal * step);
      const double samples = std::max(at.near_count, 1);
      const bool last =
          promise <= std::max(0.01 * at.near_chi2 / samples, samples * kFinestStep * kFinestStep);
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
        // As far as the quadratic model was right.
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
  static void load(const NormalEquations& at, Matrix& normal, Vector& gradient) {
    const auto n = gradient.size();
    for (Eigen::Index p = 0; p < n; ++p) {
      gradient[p] = at.gradient[static_cast<size_t>(p)];
      for (Eigen::Index q = 0; q < n; ++q)
        normal(q, p) = at.matrix[static_cast<size_t>(p)][static_cast<size_t>(q)];
    }
  }

  // `modes` after the step. Where that would leave the cone of positive Sigma, Sigma goes to the cheapest
  // point of the cone's boundary and all else follows, as the quadratic model says.
  static Footprints constrained(const Footprints& modes, const Eigen::LLT<Matrix>& solver, Vector& step) {
    const auto n = step.size();
    Matrix covariance;  // of what is still free; made when it is first needed
    for (int m = 0; m < modes.size(); ++m) {
      const Footprint& mode = modes[m];
      const Eigen::Vector3d now(mode.xx_px2, mode.xy_px2, mode.yy_px2);
      const Eigen::Index block = 6 * m + 3;
      const Eigen::Vector3d free = now + step.segment<3>(block);
      if (free[0] >= 0.0 && free[2] >= 0.0 && free[0] * free[2] >= free[1] * free[1]) continue;
      if (covariance.size() == 0) covariance = solver.solve(Matrix::Identity(n, n));
      const Eigen::Matrix3d metric = Eigen::Matrix3d(covariance.block<3, 3>(block, block)).inverse();
      const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMostParameters, 3> follow =
          covariance.middleCols<3>(block) * metric;
      step += follow * (nearest_positive(free, metric) - free);
      covariance -= follow * Matrix(covariance.middleRows<3>(block));
    }
    Footprints moved = modes;
    for (int m = 0; m < modes.size(); ++m) {
      Footprint& mode = moved[m];
      const double* d = step.data() + 6 * m;
      mode.weight += d[0];
      mode.x_px += d[1];
      mode.y_px += d[2];
      mode.xx_px2 += d[3];
      mode.xy_px2 += d[4];
      mode.yy_px2 += d[5];
    }
    return moved;
  }

  const PixelSamples& samples_;
  const MonitorExtent& extent_;
  JointWorkspace& workspace_;
  NormalEquations next_;
};

void add_errors(const NormalEquations& at, JointFit& fit) {
  const int n = 6 * fit.modes.size();
  Matrix normal(n, n);
  for (int p = 0; p < n; ++p) {
    for (int q = 0; q < n; ++q) normal(p, q) = at.matrix[static_cast<size_t>(p)][static_cast<size_t>(q)];
  }
  fit.weight_sd.fill(std::numeric_limits<double>::infinity());
  fit.centre_sd_px.fill(std::numeric_limits<double>::infinity());
  const Eigen::LLT<Matrix> solver(normal);
  if (solver.info() != Eigen::Success) return;
  const Matrix covariance = solver.solve(Matrix::Identity(n, n));
  const double variance = at.near_chi2 / std::max(at.near_count - n, 1);
  for (int m = 0; m < fit.modes.size(); ++m) {
    const auto sd = [&](double v) {
      return v >= 0.0 ? std::sqrt(v * variance) : std::numeric_limits<double>::infinity();
    };
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
                     int max_iterations, JointWorkspace& workspace) {
  Problem problem(samples, extent, workspace);
  NormalEquations at;
  JointFit fit{.modes = start};
  fit.converged = problem.minimise(fit.modes, at, max_iterations);
  for (Footprint& mode : fit.modes) mode = with_positive_covariance(mode, kLeastCovariance_px2);
  fit.chi2 = at.chi2;
  fit.near_chi2 = at.near_chi2;
  fit.near_neighbours = at.near_neighbours;
  fit.near_count = at.near_count;
  add_errors(at, fit);
  return fit;
}

}  // namespace glasswing
