#include "solver/mixture/mixture_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace glasswing {
namespace {

constexpr double kBoundSd = 0.02;  // by which a weight may be above 1
constexpr double kMaxDamping = 1e8;
constexpr double kLeastInformation = 1e-10;  // of a combination of parameters, over that of one alone
constexpr double kLittle = 1e-4;             // of chi2: a fit that gains no more has converged

struct Normal {
  FootprintMatrix matrix;
  FootprintVector gradient;
  double chi2 = 0.0, bounded = 0.0, floor = 0.0;  // bounded: chi2 and what weights above 1 cost
};

void fill(const MixtureSamples& samples, const Footprints& modes, bool through_pixels,
          MixtureWorkspace& workspace) {
  const Eigen::Index n = samples.size();
  workspace.columns.resize(n, PatternAnswers::kColumns * std::max(modes.size(), 1));
  for (int m = 0; m < modes.size(); ++m) {
    auto block = workspace.columns.middleCols(PatternAnswers::kColumns * m, PatternAnswers::kColumns);
    samples.answers->of(modes[m], through_pixels, block.data(), n);
    block.row(n - 1).setZero();
    block.array().colwise() *= samples.peak.array();
  }
}

void evaluate(const MixtureSamples& samples, const Footprints& modes, bool through_pixels,
              MixtureWorkspace& workspace, Normal& normal) {
  const Eigen::Index n = samples.size(), size = 6 * modes.size();
  normal.chi2 = residual_of(samples, modes, through_pixels, workspace, &normal.floor);
  Eigen::MatrixXd& slopes = workspace.slopes;
  slopes.resize(n, size);
  const Eigen::ArrayXd root = samples.weight.array().sqrt();
  for (int m = 0; m < modes.size(); ++m) {
    slopes.middleCols(6 * m, 6) =
        (workspace.columns.middleCols(PatternAnswers::kColumns * m + 1, 6).array().colwise() * root).matrix();
  }
  normal.matrix.resize(size, size);
  normal.matrix.setZero();
  normal.matrix.selfadjointView<Eigen::Lower>().rankUpdate(slopes.transpose());
  // The minimum over F.
  const FootprintVector by_floor = slopes.transpose() * root.matrix();
  normal.matrix.selfadjointView<Eigen::Lower>().rankUpdate(by_floor, -1.0 / samples.weight.sum());
  normal.matrix.triangularView<Eigen::StrictlyUpper>() = normal.matrix.transpose();
  normal.gradient = slopes.transpose() * (root * workspace.residual.array()).matrix();
  normal.bounded = normal.chi2;
  for (int m = 0; m < modes.size(); ++m) {
    const double excess = std::max(modes[m].weight - 1.0, 0.0), bound = 1.0 / (kBoundSd * kBoundSd);
    if (excess == 0.0) continue;
    normal.bounded += bound * excess * excess;
    normal.matrix(6 * m, 6 * m) += bound;
    normal.gradient[6 * m] -= bound * excess;
  }
}

bool sane(const Footprints& modes, const MonitorExtent& extent) {
  const double limit = 2.0 * (extent.width_px + extent.height_px);
  return std::all_of(modes.begin(), modes.end(), [&](const Footprint& mode) {
    return mode.weight > 0.0 && std::abs(mode.x_px) < limit && std::abs(mode.y_px) < limit &&
           mode.xx_px2 + mode.yy_px2 < limit * limit;
  });
}

}  // namespace

double residual_of(const MixtureSamples& samples, const Footprints& modes, bool through_pixels,
                   MixtureWorkspace& workspace, double* floor) {
  fill(samples, modes, through_pixels, workspace);
  workspace.residual = samples.y;
  for (int m = 0; m < modes.size(); ++m)
    workspace.residual -= workspace.columns.col(PatternAnswers::kColumns * m);
  *floor = samples.weight.dot(workspace.residual) / samples.weight.sum();
  workspace.residual.array() -= *floor;
  return (samples.weight.array() * workspace.residual.array().square()).sum();
}

MixtureFit fit_mixture(const MixtureSamples& samples, const Footprints& start, bool through_pixels,
                       int max_steps, MixtureWorkspace& workspace) {
  const MonitorExtent& extent = samples.answers->extent();
  MixtureFit fit{.modes = start};
  const Eigen::Index size = 6 * start.size();
  Normal at, next;
  evaluate(samples, fit.modes, through_pixels, workspace, at);
  double damping = 1e-3;
  for (int i = 0; i < max_steps && !fit.converged && damping < kMaxDamping; ++i) {
    FootprintMatrix damped = at.matrix;
    const double least = 1e-12 * at.matrix.diagonal().maxCoeff();
    damped.diagonal() += damping * at.matrix.diagonal() + FootprintVector::Constant(size, least);
    const Eigen::LLT<FootprintMatrix> solver(damped);
    FootprintVector step = solver.solve(at.gradient);
    const Footprints moved = step_within_cone(fit.modes, solver, step);
    const double promise = 2.0 * at.gradient.dot(step) - step.dot(at.matrix * step);
    // A hundredth of one sample's residual, or of its noise.
    const bool last = promise <= 0.01 * std::max(at.chi2 / static_cast<double>(samples.size()), 1.0);
    if (solver.info() == Eigen::Success && sane(moved, extent)) {
      evaluate(samples, moved, through_pixels, workspace, next);
      if (next.bounded <= at.bounded * (1.0 + 1e-9)) {
        const double gained = at.bounded - next.bounded;
        fit.modes = moved;
        std::swap(at, next);
        fit.converged = (last || gained < kLittle * at.bounded) && damping < 0.1;
        damping *= gained > 0.5 * promise ? 0.1 : gained < 0.2 * promise ? 3.0 : 1.0;
        damping = std::max(damping, 1e-7);
        continue;
      }
    }
    fit.converged = last;
    damping = std::max(10.0 * damping, 1e-4);
  }
  for (Footprint& mode : fit.modes) mode = with_positive_covariance(mode, 0.0);
  fit.chi2 = at.chi2;
  fit.floor = at.floor;
  return fit;
}

void find_errors(const MixtureSamples& samples, MixtureFit& fit, MixtureWorkspace& workspace) {
  fit.weight_sd.fill(std::numeric_limits<double>::infinity());
  fit.centre_sd_px.fill(std::numeric_limits<double>::infinity());
  const Eigen::Index size = 6 * fit.modes.size();
  if (size == 0) return;
  // As wide as the monitor's pixels make them: a point that moves within a pixel changes no sample, though
  // its place is known. Where samples tell nothing of a parameter, a footprint lies on the monitor.
  Footprints seen = fit.modes;
  for (Footprint& mode : seen) {
    mode.xx_px2 += kFlatPixel_px2;
    mode.yy_px2 += kFlatPixel_px2;
  }
  Normal normal;
  evaluate(samples, seen, false, workspace, normal);
  FootprintMatrix information = normal.matrix;
  const MonitorExtent& extent = samples.answers->extent();
  const double side_px = std::max(extent.width_px, extent.height_px);
  for (int m = 0; m < fit.modes.size(); ++m) {
    for (Eigen::Index p = 0; p < 6; ++p)
      information(6 * m + p, 6 * m + p) += std::pow(side_px, p == 0 ? 0.0 : p < 3 ? -2.0 : -4.0);
  }
  const FootprintVector unit = information.diagonal().cwiseSqrt().cwiseInverse();
  FootprintMatrix scaled = unit.asDiagonal() * information * unit.asDiagonal();
  scaled.diagonal().array() += kLeastInformation;
  const Eigen::LLT<FootprintMatrix> solver(scaled);
  if (solver.info() != Eigen::Success) return;
  const FootprintMatrix covariance =
      unit.asDiagonal() * solver.solve(FootprintMatrix::Identity(size, size)) * unit.asDiagonal();
  for (int m = 0; m < fit.modes.size(); ++m) {
    const Eigen::Index k = 6 * m;
    const auto i = static_cast<size_t>(m);
    fit.weight_sd[i] = std::sqrt(covariance(k, k));
    fit.centre_sd_px[i] = std::sqrt(0.5 * (covariance(k + 1, k + 1) + covariance(k + 2, k + 2)));
  }
}

}  // namespace glasswing
