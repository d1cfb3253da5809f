#include "solver/fringe/spectrum_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/footprint/minimise.h"
#include "core/footprint/wave_answer.h"

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr Eigen::Index kParameters = 6;
constexpr int kFirstSteps = 6;
constexpr double kPointsAPeriod = 5.0;  // of the finest wave
constexpr double kMaxPoints = 64.0;     // along an axis

// Between the points along an axis.
double step_of(const std::vector<Wave>& waves, double Wave::*frequency, double side_px) {
  double high = 0.0;
  for (const Wave& wave : waves) high = std::max(high, std::abs(wave.*frequency));
  return std::max(1.0 / (kPointsAPeriod * high), side_px / kMaxPoints);
}

bool sane(const Footprints& modes, const MonitorExtent& extent) {
  const double limit = 2.0 * (extent.width_px + extent.height_px);
  return std::all_of(modes.begin(), modes.end(), [&](const Footprint& mode) {
    return mode.weight > 0.0 && std::abs(mode.x_px) < limit && std::abs(mode.y_px) < limit &&
           mode.xx_px2 + mode.yy_px2 < limit * limit;
  });
}

}  // namespace

// J'J, J'r and r'r over the measured numbers.
struct SpectrumFitter::Normal : FootprintEquations {
  double tolerated = 0.0, closely = 0.0;
  int count = 0;

  Normal() = default;
  explicit Normal(Eigen::Index size) {
    matrix.setZero(size, size);
    gradient.setZero(size);
  }
  void add(const FootprintVector& slope, double left, double variance, double tolerance) {
    matrix.noalias() += slope * slope.transpose() / variance;
    gradient += slope * (left / variance);
    cost += left * left / variance;
    tolerated += left * left / (variance + tolerance * tolerance);
    closely += left * left / (variance + tolerance * tolerance / 16.0);
    ++count;
  }
};

SpectrumFitter::SpectrumFitter(const WaveMonitor& monitor, double tolerance, bool several)
    : monitor_(monitor), tolerance_(tolerance) {
  for (const Wave& wave : monitor.waves) oblique_ = oblique_ || wave.fx * wave.fy != 0.0;
  if (!several) return;
  const double step_x = step_of(monitor.waves, &Wave::fx, monitor.extent.width_px),
               step_y = step_of(monitor.waves, &Wave::fy, monitor.extent.height_px);
  const double variance_x = step_x * step_x / 12.0, variance_y = step_y * step_y / 12.0;
  for (double y = 0.5 * step_y; y < monitor.extent.height_px; y += step_y) {
    for (double x = 0.5 * step_x; x < monitor.extent.width_px; x += step_x) {
      points_.push_back(
          {.weight = 1.0, .x_px = x, .y_px = y, .xx_px2 = variance_x, .xy_px2 = 0.0, .yy_px2 = variance_y});
      for (const Wave& wave : monitor.waves)
        answers_.emplace_back(answer_of(points_.back(), wave.fx, wave.fy, monitor.extent).value);
      answers_.emplace_back(answer_of(points_.back(), 0.0, 0.0, monitor.extent).value);
    }
  }
}

SpectrumFitter::Normal SpectrumFitter::normal_at(const Spectrum& spectrum,
                                                 const std::vector<bool>& phase_known,
                                                 const Footprints& modes) const {
  const Eigen::Index size = kParameters * modes.size();
  Normal normal(size);
  FootprintVector re(size), im(size);
  double light = 0.0;
  for (const Footprint& mode : modes) light += mode.weight;
  const double tolerance = tolerance_ * light;
  const auto answer = [&](double fx, double fy) {
    Complex sum = 0.0;
    Eigen::Index at = 0;
    for (const Footprint& mode : modes) {
      const WaveAnswer own = answer_of(mode, fx, fy, monitor_.extent);
      sum += own.value;
      for (const Complex& slope : own.slope) {
        re[at] = slope.real();
        im[at++] = slope.imag();
      }
    }
    return sum;
  };
  if (std::isfinite(spectrum.level_sd)) {
    const Complex model = answer(0.0, 0.0);
    normal.add(re, spectrum.level - model.real(), spectrum.level_sd * spectrum.level_sd, tolerance);
  }
  for (size_t w = 0; w < monitor_.waves.size(); ++w) {
    const Phasor& phasor = spectrum.phasors[w];
    if (!std::isfinite(phasor.sd)) continue;
    const Complex model = answer(monitor_.waves[w].fx, monitor_.waves[w].fy);
    const double variance = phasor.sd * phasor.sd;
    if (phase_known[w]) {
      normal.add(re, phasor.value.real() - model.real(), variance, tolerance);
      normal.add(im, phasor.value.imag() - model.imag(), variance, tolerance);
      continue;
    }
    const double size_model = std::abs(model);
    // Noise increases a phasor's magnitude.
    const double seen = std::sqrt(std::max(std::norm(phasor.value) - variance, 0.0));
    if (size_model > 0.0) re = (model.real() * re + model.imag() * im) / size_model;
    normal.add(re, seen - size_model, variance, tolerance);
  }
  // Parameters without slopes stay where they are.
  const double held = normal.matrix.diagonal().maxCoeff();
  for (Eigen::Index m = 0; !oblique_ && m < modes.size(); ++m) {
    const Eigen::Index xy = kParameters * m + 4;
    normal.matrix.row(xy).setZero();
    normal.matrix.col(xy).setZero();
    normal.matrix(xy, xy) = held;
    normal.gradient[xy] = 0.0;
  }
  // A hundredth of one number's residual, or of its noise.
  normal.enough = 0.01 * std::max(normal.cost / std::max(normal.count, 1), 1.0);
  return normal;
}

// ln |H| - ln sinc = ln R - 2 pi^2 f' Sigma f; each weighted by |H|^2 / variance.
Footprint SpectrumFitter::guess(const Spectrum& spectrum, const Unwrapped& place) const {
  Eigen::Matrix4d matrix =
      Eigen::Vector4d(0.0, 1e-6, 1e-6, 1e-6).asDiagonal();  // in case they are undetermined
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const auto add = [&](double fx, double fy, double size, double sd) {
    if (!(size > 3.0 * sd)) return;
    const double scale = -2.0 * std::numbers::pi * std::numbers::pi;
    const Eigen::Vector4d row(1.0, scale * fx * fx, 2.0 * scale * fx * fy, scale * fy * fy);
    const double weight = size * size / (sd * sd);
    matrix += weight * row * row.transpose();
    right += weight * row * std::log(size / (sinc(fx) * sinc(fy)));
  };
  if (std::isfinite(spectrum.level_sd)) add(0.0, 0.0, spectrum.level, spectrum.level_sd);
  for (size_t w = 0; w < monitor_.waves.size(); ++w) {
    const Phasor& phasor = spectrum.phasors[w];
    if (std::isfinite(phasor.sd))
      add(monitor_.waves[w].fx, monitor_.waves[w].fy, std::abs(phasor.value), phasor.sd);
  }
  const Eigen::Vector4d found = matrix.ldlt().solve(right);
  return with_positive_covariance({.weight = std::exp(found[0]),
                                   .x_px = place.centre_px.x(),
                                   .y_px = place.centre_px.y(),
                                   .xx_px2 = found[1],
                                   .xy_px2 = oblique_ ? found[2] : 0.0,
                                   .yy_px2 = found[3]},
                                  0.0);
}

SpectrumFit SpectrumFitter::fit(const Spectrum& spectrum, const std::vector<bool>& phase_known,
                                const Footprints& start, int max_steps) const {
  const Eigen::Index size = kParameters * start.size();
  const auto evaluate = [&](const Footprints& modes, Normal& at) {
    at = normal_at(spectrum, phase_known, modes);
  };
  const auto is_sane = [&](const Footprints& modes) { return sane(modes, monitor_.extent); };
  const Minimum<Normal> found = minimise<Normal>(start, evaluate, is_sane, {.max_steps = max_steps});
  const Normal& normal = found.at;
  SpectrumFit result{.modes = found.modes, .converged = found.converged};
  result.chi_square = normal.cost;
  result.tolerated = normal.tolerated;
  result.closely = normal.closely;
  result.count = normal.count;
  result.degrees = normal.count - static_cast<int>(oblique_ ? size : size - start.size());
  result.weight_sd.fill(kUnknown);
  result.centre_sd_px.fill(kUnknown);
  const FootprintCholesky factor(normal.matrix);
  if (!factor.positive()) return result;
  const FootprintMatrix covariance = factor.inverse();
  for (int m = 0; m < result.modes.size(); ++m) {
    const Eigen::Index at = kParameters * m;
    const size_t i = m;
    result.weight_sd[i] = std::sqrt(covariance(at, at));
    result.centre_sd_px[i] = std::sqrt(0.5 * (covariance(at + 1, at + 1) + covariance(at + 2, at + 2)));
  }
  return result;
}

std::vector<Complex> SpectrumFitter::left_by(const Spectrum& spectrum, const Footprints& modes) const {
  std::vector<Complex> left;
  const auto add = [&](Complex seen, double sd, double fx, double fy) {
    left.push_back(std::isfinite(sd) ? seen : 0.0);
    for (const Footprint& mode : modes) {
      if (std::isfinite(sd)) left.back() -= answer_of(mode, fx, fy, monitor_.extent).value;
    }
  };
  for (size_t w = 0; w < monitor_.waves.size(); ++w)
    add(spectrum.phasors[w].value, spectrum.phasors[w].sd, monitor_.waves[w].fx, monitor_.waves[w].fy);
  add(spectrum.level, spectrum.level_sd, 0.0, 0.0);
  return left;
}

Footprint SpectrumFitter::best_point(const Spectrum& spectrum, std::span<const Complex> left) const {
  std::vector<float> information;
  std::vector<std::complex<float>> weighted;
  for (size_t w = 0; w < left.size(); ++w) {
    const double sd = w < spectrum.phasors.size() ? spectrum.phasors[w].sd : spectrum.level_sd;
    information.push_back(std::isfinite(sd) ? static_cast<float>(1.0 / (sd * sd)) : 0.0f);
    weighted.push_back(std::complex<float>(left[w]) * information.back());
  }
  float best_gain = -1.0f, best_weight = 0.0f;
  size_t best = 0;
  const std::complex<float>* answer = answers_.data();
  for (size_t p = 0; p < points_.size(); ++p) {
    float both = 0.0f, square = 0.0f;
    for (size_t w = 0; w < left.size(); ++w, ++answer) {
      both += answer->real() * weighted[w].real() + answer->imag() * weighted[w].imag();
      square += information[w] * (answer->real() * answer->real() + answer->imag() * answer->imag());
    }
    const float gain = std::max(both, 0.0f) * both / square;
    if (gain <= best_gain) continue;
    best = p;
    best_gain = gain;
    best_weight = both / square;
  }
  Footprint point = points_[best];
  point.weight = static_cast<double>(best_weight);
  return point;
}

SpectrumFit SpectrumFitter::fit_one_more(const Spectrum& spectrum, const SpectrumFit& fit) const {
  std::vector<Footprints> starts;
  const std::vector<bool> all(monitor_.waves.size(), true);
  const auto add_best_point = [&](Footprints modes) {
    const Footprint point = best_point(spectrum, left_by(spectrum, modes));
    if (!(point.weight > 0.0)) return modes;
    modes.push_back(point);
    return modes;
  };
  starts.push_back(add_best_point(fit.modes));
  // Without a previous fit.
  Footprints points;
  while (points.size() <= fit.modes.size()) {
    const int before = points.size();
    points = add_best_point(points);
    if (points.size() == before) break;
  }
  starts.push_back(points);
  for (int m = 0; m < fit.modes.size(); ++m) {
    Footprint upright = fit.modes[m];
    upright.xy_px2 = 0.0;
    for (const SplitAxis axis : {SplitAxis::kWide, SplitAxis::kNarrow}) {
      const auto [half, other] = split(upright, axis);
      Footprints parts = fit.modes;
      parts[m] = half;
      parts.push_back(other);
      starts.push_back(parts);
    }
  }
  SpectrumFit best;
  for (const Footprints& start : starts) {
    if (start.size() != fit.modes.size() + 1) continue;
    const SpectrumFit own = this->fit(spectrum, all, start, kFirstSteps);
    if (best.modes.empty() || own.chi_square < best.chi_square) best = own;
  }
  if (!best.modes.empty() && !best.converged) best = this->fit(spectrum, all, best.modes, kMaxFitSteps);
  return best;
}

}  // namespace glasswing
