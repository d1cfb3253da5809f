#include "solver/gaussian/joint_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace glasswing {
namespace {

using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostParameters, 1>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostParameters, kMostParameters>;

constexpr double kLeastCovariance_px2 = 1e-4;

// Of Sigma = L L', L = (a 0; b c), stored in a footprint's place of (xx, xy, yy).
struct Factor {
  double a, b, c;
};

Factor factor_of(const Footprint& mode) {
  const double a = std::sqrt(std::max(mode.xx_px2, kLeastCovariance_px2));
  const double b = mode.xy_px2 / a;
  return {a, b, std::sqrt(std::max(mode.yy_px2 - b * b, kLeastCovariance_px2))};
}

bool positive(const Footprint& mode) {
  return mode.xx_px2 >= 0.0 && mode.yy_px2 >= 0.0 && mode.xx_px2 * mode.yy_px2 >= mode.xy_px2 * mode.xy_px2;
}

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

class Problem {
 public:
  Problem(const PixelSamples& samples, const MonitorExtent& extent, JointWorkspace& workspace)
      : samples_(samples), extent_(extent), workspace_(workspace) {}

  // Levenberg-Marquardt; true if it settled.
  bool minimise(Footprints& modes, NormalEquations& at, bool factored, int max_iterations) {
    const int n = 6 * modes.size();
    double damping = 1e-3;
    Matrix normal(n, n);
    Vector gradient(n);
    NormalEquations& next = next_;
    linearise(modes, at, factored, normal, gradient);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      Matrix damped = normal;
      const double floor = 1e-12 * normal.diagonal().maxCoeff();
      damped.diagonal() += damping * normal.diagonal() + Vector::Constant(n, floor);
      const Eigen::LLT<Matrix> solver(damped);
      const Vector step = solver.solve(gradient);
      // gradient . step is the squared distance to the minimum in units of the noise.
      const double noise =
          at.chi2 > 0.0 ? std::max(at.near_chi2, 1e-3 * at.chi2) / std::max(at.near_count, 1) : 0.0;
      const double decrement = gradient.dot(step);
      const bool last = decrement <= 0.01 * noise;
      const Footprints moved = after(modes, step, factored);
      bool better = solver.info() == Eigen::Success && sane(moved, *samples_.layout, extent_);
      if (better) {
        evaluate(samples_, moved, extent_, workspace_, next);
        better = next.chi2 <= at.chi2 * (1.0 + 1e-7);
      }
      if (better) {
        modes = moved;
        std::swap(at, next);
        damping = std::max(0.1 * damping, 1e-7);
        if (last && damping < 0.1) return true;
        turn(modes, at, factored, normal, gradient);
      } else {
        if (last) return true;
        damping *= 10.0;
        if (damping > 1e9) return false;
      }
    }
    return false;
  }

 private:
  void linearise(const Footprints& modes, NormalEquations& at, bool factored, Matrix& normal,
                 Vector& gradient) {
    evaluate(samples_, modes, extent_, workspace_, at);
    turn(modes, at, factored, normal, gradient);
  }

  // The equations in Eigen's types; by (a, b, c) instead of (xx, xy, yy) if factored.
  static void turn(const Footprints& modes, const NormalEquations& at, bool factored, Matrix& normal,
                   Vector& gradient) {
    const int n = 6 * modes.size();
    for (int p = 0; p < n; ++p) {
      gradient[p] = at.gradient[static_cast<size_t>(p)];
      for (int q = 0; q < n; ++q) normal(p, q) = at.matrix[static_cast<size_t>(p)][static_cast<size_t>(q)];
    }
    if (!factored) return;
    for (int m = 0; m < modes.size(); ++m) {
      const Factor f = factor_of(modes[m]);
      Eigen::Matrix3d by_factor;
      by_factor << 2.0 * f.a, 0.0, 0.0, f.b, f.a, 0.0, 0.0, 2.0 * f.b, 2.0 * f.c;
      const int at_row = 6 * m + 3;
      gradient.segment<3>(at_row) = by_factor.transpose() * Eigen::Vector3d(gradient.segment<3>(at_row));
      const Matrix columns = normal.middleCols(at_row, 3) * by_factor;
      normal.middleCols(at_row, 3) = columns;
      const Matrix rows = by_factor.transpose() * normal.middleRows(at_row, 3);
      normal.middleRows(at_row, 3) = rows;
    }
  }

  static Footprints after(const Footprints& modes, const Vector& step, bool factored) {
    Footprints moved = modes;
    for (int m = 0; m < modes.size(); ++m) {
      Footprint& mode = moved[m];
      const double* d = step.data() + 6 * m;
      mode.weight += d[0];
      mode.x_px += d[1];
      mode.y_px += d[2];
      if (factored) {
        Factor f = factor_of(mode);
        f.a += d[3];
        f.b += d[4];
        f.c += d[5];
        mode.xx_px2 = f.a * f.a;
        mode.xy_px2 = f.a * f.b;
        mode.yy_px2 = f.b * f.b + f.c * f.c;
      } else {
        mode.xx_px2 += d[3];
        mode.xy_px2 += d[4];
        mode.yy_px2 += d[5];
      }
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
  fit.converged = problem.minimise(fit.modes, at, false, max_iterations);
  if (!std::all_of(fit.modes.begin(), fit.modes.end(), positive)) {
    for (Footprint& mode : fit.modes) mode = with_positive_covariance(mode, kLeastCovariance_px2);
    fit.converged = problem.minimise(fit.modes, at, true, max_iterations);
  }
  fit.chi2 = at.chi2;
  fit.near_chi2 = at.near_chi2;
  fit.near_count = at.near_count;
  add_errors(at, fit);
  return fit;
}

}  // namespace glasswing
