#include "solver/gaussian/footprint_fit.h"

#include <ceres/tiny_solver.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kFlatPixel_px2 = 1.0 / 12.0;
constexpr int kParameters = 6;   // of a mode: R, cx, cy and L, Sigma = L L'
constexpr double kWindow = 4.5;  // sigmas round a mode in which samples count

double projected_variance(const Footprint& mode, const SweepSamples& sweep) {
  const double c = sweep.cos_phi, s = sweep.sin_phi;
  return c * c * mode.xx_px2 + 2.0 * c * s * mode.xy_px2 + s * s * mode.yy_px2 +
         sweep.sigma_px * sweep.sigma_px + kFlatPixel_px2;
}

double within(double mean, double variance, double extent) {
  const double scale = 1.0 / std::sqrt(2.0 * std::max(variance, 1e-6));
  return 0.5 * (std::erf((extent - mean) * scale) + std::erf(mean * scale));
}

double inside(const Footprint& mode, const SweepSamples& sweep, double r_px, const MonitorExtent& extent) {
  const double variance = projected_variance(mode, sweep);
  const double gx = mode.xx_px2 * sweep.cos_phi + mode.xy_px2 * sweep.sin_phi;
  const double gy = mode.xy_px2 * sweep.cos_phi + mode.yy_px2 * sweep.sin_phi;
  const double pull = (r_px - mode.x_px * sweep.cos_phi - mode.y_px * sweep.sin_phi) / variance;
  return within(mode.x_px + gx * pull, mode.xx_px2 - gx * gx / variance, extent.width_px) *
         within(mode.y_px + gy * pull, mode.yy_px2 - gy * gy / variance, extent.height_px);
}

bool near_edge(const Footprint& mode, const MonitorExtent& extent) {
  const double reach_x = 4.0 * std::sqrt(mode.xx_px2) + 0.5;
  const double reach_y = 4.0 * std::sqrt(mode.yy_px2) + 0.5;
  return mode.x_px < reach_x || mode.y_px < reach_y || mode.x_px > extent.width_px - reach_x ||
         mode.y_px > extent.height_px - reach_y;
}

Footprint footprint_of(const double* p) {
  return {.weight = p[0],
          .x_px = p[1],
          .y_px = p[2],
          .xx_px2 = p[3] * p[3],
          .xy_px2 = p[3] * p[4],
          .yy_px2 = p[4] * p[4] + p[5] * p[5]};
}

void parameters_of(const Footprint& mode, double* p) {
  p[0] = mode.weight;
  p[1] = mode.x_px;
  p[2] = mode.y_px;
  p[3] = std::sqrt(std::max(mode.xx_px2, 1e-3));
  p[4] = mode.xy_px2 / p[3];
  p[5] = std::sqrt(std::max(mode.yy_px2 - p[4] * p[4], 1e-3));
}

// A sample that counts, with inside(r) of each mode held fixed during one round of the fit.
struct Sample {
  const SweepSamples* sweep;
  double r_px, y;
  std::array<double, 3> inside{1.0, 1.0, 1.0};
};

template <int kModes>
struct JointResidual {
  using Scalar = double;
  enum { NUM_PARAMETERS = kParameters * kModes, NUM_RESIDUALS = Eigen::Dynamic };
  const std::vector<Sample>& samples;

  int NumResiduals() const { return static_cast<int>(samples.size()); }
  bool operator()(const double* p, double* residuals, double* jacobian) const {
    const size_t n = samples.size();
    for (size_t i = 0; i < n; ++i) {
      const Sample& sample = samples[i];
      const double c = sample.sweep->cos_phi, s = sample.sweep->sin_phi;
      residuals[i] = -sample.y;
      for (int m = 0; m < kModes; ++m) {
        const double* q = p + kParameters * m;
        // s' L = (a, b): the variance along the sweep is a^2 + b^2.
        const double a = c * q[3] + s * q[4], b = s * q[5];
        const double variance =
            a * a + b * b + sample.sweep->sigma_px * sample.sweep->sigma_px + kFlatPixel_px2;
        const double sigma = std::sqrt(variance);
        const double z = (sample.r_px - c * q[1] - s * q[2]) / sigma;
        const double unit =
            sample.inside[static_cast<size_t>(m)] * sample.sweep->sigma_px / sigma * std::exp(-0.5 * z * z);
        const double value = q[0] * unit;
        residuals[i] += value;
        if (jacobian == nullptr) continue;
        double* column = jacobian + static_cast<size_t>(kParameters * m) * n + i;
        const double by_centre = value * z / sigma;
        const double by_variance = 0.5 * value * (z * z - 1.0) / variance;
        column[0] = unit;
        column[n] = by_centre * c;
        column[2 * n] = by_centre * s;
        column[3 * n] = by_variance * 2.0 * a * c;
        column[4 * n] = by_variance * 2.0 * a * s;
        column[5 * n] = by_variance * 2.0 * b * s;
      }
    }
    return true;
  }
};

// Which samples lie within reach of a mode.
std::vector<Sample> window_of(const std::vector<SweepSamples>& sweeps, const std::vector<Footprint>& modes,
                              const MonitorExtent& extent) {
  std::vector<Sample> samples;
  for (const SweepSamples& sweep : sweeps) {
    for (size_t i = 0; i < sweep.y.size(); ++i) {
      Sample sample{.sweep = &sweep, .r_px = sweep.r_px[i], .y = sweep.y[i]};
      bool counts = false;
      for (size_t m = 0; m < modes.size(); ++m) {
        const double centre = modes[m].x_px * sweep.cos_phi + modes[m].y_px * sweep.sin_phi;
        counts = counts ||
                 std::abs(sample.r_px - centre) < kWindow * std::sqrt(projected_variance(modes[m], sweep));
        if (near_edge(modes[m], extent)) sample.inside[m] = inside(modes[m], sweep, sample.r_px, extent);
      }
      if (counts) samples.push_back(sample);
    }
  }
  return samples;
}

bool sane(const Footprint& mode, const MonitorExtent& extent) {
  const double limit = 2.0 * (extent.width_px + extent.height_px);
  return std::isfinite(mode.weight + mode.x_px + mode.y_px + mode.xx_px2 + mode.xy_px2 + mode.yy_px2) &&
         std::abs(mode.x_px) < limit && std::abs(mode.y_px) < limit &&
         mode.xx_px2 + mode.yy_px2 < limit * limit;
}

// The joint Levenberg-Marquardt over all sweeps. False: it went astray, and `modes` is as before.
template <int kModes>
bool refine(const std::vector<SweepSamples>& sweeps, const MonitorExtent& extent,
            std::vector<Footprint>& modes) {
  std::vector<Footprint> now = modes;
  bool settled = false;
  const bool edge =
      std::any_of(now.begin(), now.end(), [&](const Footprint& m) { return near_edge(m, extent); });
  // The window, and what the edge cuts off, follow the fit from round to round.
  const int rounds = edge ? 6 : 2;
  for (int round = 0; round < rounds; ++round) {
    const std::vector<Sample> samples = window_of(sweeps, now, extent);
    if (samples.size() < static_cast<size_t>(kParameters * kModes) + 2) return false;
    using Residual = JointResidual<kModes>;
    Residual residual{samples};
    ceres::TinySolver<Residual> solver;
    solver.options.max_num_iterations = 25;
    solver.options.gradient_tolerance = 1e-9;
    solver.options.parameter_tolerance = 1e-6;
    Eigen::Matrix<double, Residual::NUM_PARAMETERS, 1> p;
    for (int m = 0; m < kModes; ++m) parameters_of(now[static_cast<size_t>(m)], p.data() + kParameters * m);
    solver.Solve(residual, &p);
    settled = solver.summary.status != ceres::TinySolver<Residual>::HIT_MAX_ITERATIONS || round + 1 < rounds;
    for (int m = 0; m < kModes; ++m) now[static_cast<size_t>(m)] = footprint_of(p.data() + kParameters * m);
    for (const Footprint& mode : now) {
      if (!sane(mode, extent)) return false;
    }
  }
  modes = std::move(now);
  return settled;
}

bool refine_any(const std::vector<SweepSamples>& sweeps, const MonitorExtent& extent,
                std::vector<Footprint>& modes) {
  switch (modes.size()) {
    case 1:
      return refine<1>(sweeps, extent, modes);
    case 2:
      return refine<2>(sweeps, extent, modes);
    default:
      return refine<3>(sweeps, extent, modes);
  }
}

std::vector<SweepSamples> without(const std::vector<SweepSamples>& sweeps,
                                  const std::vector<Footprint>& modes, const MonitorExtent& extent) {
  std::vector<SweepSamples> rest = sweeps;
  for (SweepSamples& sweep : rest) {
    for (size_t i = 0; i < sweep.y.size(); ++i) {
      for (const Footprint& mode : modes) sweep.y[i] -= response(mode, sweep, sweep.r_px[i], extent);
    }
  }
  return rest;
}

double sum_of_squares(const std::vector<SweepSamples>& sweeps) {
  double sum = 0.0;
  for (const SweepSamples& sweep : sweeps) {
    for (const double y : sweep.y) sum += y * y;
  }
  return sum;
}

// The mode that one peak from every sweep agrees on best; false if some sweep has none.
bool strongest_mode(const std::vector<SweepSamples>& sweeps, double floor, Footprint* best) {
  constexpr int kPeaks = 3;
  constexpr double kTolerance_px = 2.0;
  std::vector<std::vector<Peak>> peaks;
  for (const SweepSamples& sweep : sweeps) {
    peaks.push_back(find_peaks(sweep.r_px, sweep.y, floor, kPeaks));
    if (peaks.back().empty()) return false;
  }
  double best_score = -1.0;
  std::vector<size_t> choice(sweeps.size(), 0);
  while (true) {
    std::vector<Peak> tuple;
    double light = 0.0, least = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < sweeps.size(); ++i) {
      tuple.push_back(peaks[i][choice[i]]);
      // amplitude * sigma is R sigma_s in every sweep, whatever the footprint's direction.
      const double area = tuple.back().amplitude * tuple.back().sigma_px / sweeps[i].sigma_px;
      light += area / static_cast<double>(sweeps.size());
      least = std::min(least, area);
    }
    double distance_px = 0.0;
    const Footprint mode = intersect(sweeps, tuple, &distance_px);
    const double miss = distance_px / kTolerance_px;
    const double score = (0.5 * light + 0.5 * least) * std::exp(-0.5 * miss * miss);
    if (score > best_score) {
      best_score = score;
      *best = mode;
    }
    size_t i = 0;
    while (i < choice.size() && ++choice[i] == peaks[i].size()) choice[i++] = 0;
    if (i == choice.size()) return true;
  }
}

}  // namespace

double response(const Footprint& mode, const SweepSamples& sweep, double r_px, const MonitorExtent& extent) {
  const double variance = projected_variance(mode, sweep);
  const double offset = r_px - mode.x_px * sweep.cos_phi - mode.y_px * sweep.sin_phi;
  const double whole =
      mode.weight * sweep.sigma_px / std::sqrt(variance) * std::exp(-0.5 * offset * offset / variance);
  return near_edge(mode, extent) ? whole * inside(mode, sweep, r_px, extent) : whole;
}

Footprint intersect(const std::vector<SweepSamples>& sweeps, const std::vector<Peak>& peaks,
                    double* distance_px) {
  Eigen::Matrix2d lines = Eigen::Matrix2d::Zero();
  Eigen::Vector2d towards = Eigen::Vector2d::Zero();
  Eigen::Matrix3d widths = Eigen::Matrix3d::Zero();
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for (size_t i = 0; i < sweeps.size(); ++i) {
    const double c = sweeps[i].cos_phi, s = sweeps[i].sin_phi;
    const Eigen::Vector2d axis(c, s);
    lines += axis * axis.transpose();
    towards += peaks[i].centre_px * axis;
    const Eigen::Vector3d square(c * c, 2.0 * c * s, s * s);
    widths += square * square.transpose();
    seen +=
        (peaks[i].sigma_px * peaks[i].sigma_px - sweeps[i].sigma_px * sweeps[i].sigma_px - kFlatPixel_px2) *
        square;
    weight +=
        peaks[i].amplitude * peaks[i].sigma_px / sweeps[i].sigma_px / static_cast<double>(sweeps.size());
  }
  const Eigen::Vector2d centre = lines.ldlt().solve(towards);
  const Eigen::Vector3d sigma = widths.ldlt().solve(seen);
  double squares = 0.0;
  for (size_t i = 0; i < sweeps.size(); ++i) {
    const double miss = centre.x() * sweeps[i].cos_phi + centre.y() * sweeps[i].sin_phi - peaks[i].centre_px;
    squares += miss * miss;
  }
  *distance_px = std::sqrt(squares / static_cast<double>(sweeps.size()));
  Eigen::Matrix2d covariance;
  covariance << sigma[0], sigma[1], sigma[1], sigma[2];
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Eigen::Vector2d kept = eigen.eigenvalues().cwiseMax(0.01);
  covariance = eigen.eigenvectors() * kept.asDiagonal() * eigen.eigenvectors().transpose();
  return {.weight = weight,
          .x_px = centre.x(),
          .y_px = centre.y(),
          .xx_px2 = covariance(0, 0),
          .xy_px2 = covariance(0, 1),
          .yy_px2 = covariance(1, 1)};
}

FootprintFit fit_footprints(const std::vector<SweepSamples>& sweeps, const MonitorExtent& extent,
                            double noise_sd, int max_modes) {
  FootprintFit fit;
  size_t count = 0;
  for (const SweepSamples& sweep : sweeps) count += sweep.y.size();
  const auto n = static_cast<double>(count);
  const double floor = std::max(4.0 * noise_sd, 0.0015);
  // Below this a residual is noise or the quantisation of the frames, whatever the criterion thinks of it.
  const double least_squares = n * std::max(noise_sd * noise_sd, 1e-8);
  double squares = sum_of_squares(sweeps);
  std::vector<SweepSamples> rest = sweeps;
  while (static_cast<int>(fit.modes.size()) < max_modes) {
    Footprint mode;
    if (!strongest_mode(rest, floor, &mode)) break;
    std::vector<Footprint> modes = fit.modes;
    modes.push_back(mode);
    const bool settled = refine_any(sweeps, extent, modes);
    if (!settled && !fit.modes.empty()) break;
    std::vector<SweepSamples> left = without(sweeps, modes, extent);
    const double left_squares = sum_of_squares(left);
    const double gain =
        n * std::log(std::max(squares, least_squares) / std::max(left_squares, least_squares));
    const bool negative =
        std::any_of(modes.begin(), modes.end(), [](const Footprint& m) { return m.weight < 0.0; });
    if (!fit.modes.empty() && (negative || gain < kParameters * std::log(n))) break;
    fit.converged = settled && !negative;
    fit.modes = std::move(modes);
    rest = std::move(left);
    squares = left_squares;
  }
  for (Footprint& mode : fit.modes) mode.weight = std::max(mode.weight, 0.0);
  std::sort(fit.modes.begin(), fit.modes.end(),
            [](const Footprint& a, const Footprint& b) { return a.weight > b.weight; });
  fit.rms = std::sqrt(squares / std::max(n, 1.0));
  return fit;
}

}  // namespace glasswing
