#include "solver/gaussian/kernels/joint_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

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

// Of the diagonal. Within a pixel the derivatives by place and width vanish: each counts as if it moved what
// stripes see by a tenth of itself. A peak's squares sum to R^2 N_RR; its derivative by the centre has half
// of that over sigma_r^2, by sigma_r^2 three sixteenths over its square, half of it along either axis.
FootprintVector least_of(const SampleLayout& layout, const Footprints& modes, const FootprintMatrix& normal) {
  constexpr double kShare = 0.01, kCentre = 0.25, kSpread = 3.0 / 32.0;
  double sigma_px = INFINITY;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) sigma_px = std::min(sigma_px, sweep.axis.sigma_px);
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

void hold(unsigned held, NormalEquations& at) {
  for (Eigen::Index p = 0; p < at.gradient.size(); ++p) {
    if ((held >> p & 1u) == 0) continue;
    at.matrix.row(p).setZero();
    at.matrix.col(p).setZero();
    at.matrix(p, p) = 1.0;
    at.gradient[p] = 0.0;
  }
}

void add_errors(const NormalEquations& at, double bound_weight, unsigned held, JointFit& fit) {
  const int n = 6 * fit.modes.size();
  FootprintMatrix normal = at.matrix;
  // That weights end at 1 does not show how well the samples determine one.
  for (int m = 0; m < fit.modes.size(); ++m) {
    if (fit.modes[m].weight > 1.0) normal(6 * m, 6 * m) -= bound_weight;
  }
  const double variance = at.near_chi2 / std::max(at.near_count - n, 1);
  const double unit = std::max(variance, kMinStep * kMinStep);
  for (int m = 0; m < fit.modes.size(); ++m) {
    const std::array<double, 5> known = known_within_pixel(fit.modes[m]);
    for (int i = 0; i < 5; ++i) normal(6 * m + 1 + i, 6 * m + 1 + i) += unit * known[i];
  }
  fit.weight_sd.fill(std::numeric_limits<double>::infinity());
  fit.centre_sd_px.fill(std::numeric_limits<double>::infinity());
  fit.light_sd = std::numeric_limits<double>::infinity();
  const FootprintCholesky factor(normal);
  if (!factor.positive()) return;
  FootprintMatrix covariance = factor.inverse();
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
    fit.weight_sd[m] = sd(covariance(6 * m, 6 * m));
    fit.centre_sd_px[m] = sd(0.5 * (covariance(6 * m + 1, 6 * m + 1) + covariance(6 * m + 2, 6 * m + 2)));
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
  offset_px.resize(sweep.first + sweep.padded_count, offset_px.back());
  sweeps.push_back(sweep);
}

JointFit fit_jointly(const PixelSamples& samples, const Footprints& start, const MonitorExtent& extent,
                     const StepLimits& limits, JointWorkspace& workspace, unsigned held) {
  constexpr double kEnough = 0.01;    // of one sample's residual: a tenth of a standard error
  constexpr double kLittle = 2e-4;    // of chi2
  constexpr double kRounding = 1e-7;  // of sums of floats
  const Minimum<NormalEquations> found = minimise<NormalEquations>(
      start,
      [&](const Footprints& modes, NormalEquations& at) {
        evaluate(samples, modes, extent, workspace, at);
        hold(held, at);
        at.least = least_of(*samples.layout, modes, at.matrix);
        const double count = std::max(at.near_count, 1);
        at.enough = std::max(kEnough * at.near_chi2 / count, count * kMinStep * kMinStep);
        at.little = kLittle * at.near_chi2;
        at.rounding = kRounding;
      },
      [&](const Footprints& modes) { return sane(modes, *samples.layout, extent); }, limits);
  JointFit fit{.modes = found.modes,
               .chi2 = found.at.cost,
               .near_chi2 = found.at.near_chi2,
               .near_neighbours = found.at.near_neighbours,
               .near_count = found.at.near_count,
               .floor = found.at.floor,
               .converged = found.converged};
  for (Footprint& mode : fit.modes) mode = with_positive_covariance(mode, kMinCovariance_px2);
  add_errors(found.at, samples.bound_weight, held, fit);
  return fit;
}

}  // namespace glasswing
