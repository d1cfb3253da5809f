#include "solver/fringe/phasor.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

// Weighted least squares of  sample = F + light H(0).
struct Line {
  double n = 0.0, x = 0.0, xx = 0.0, y = 0.0, xy = 0.0;
  void add(double light, double sample, double variance) {
    const double information = 1.0 / variance;
    n += information;
    x += information * light;
    xx += information * light * light;
    y += information * sample;
    xy += information * light * sample;
  }
  double spread() const { return n > 0.0 ? xx - x * x / n : 0.0; }
  bool known() const { return spread() > 1e-6 * xx; }
  double slope() const { return (xy - x * y / n) / spread(); }
  double at(double light) const { return y / n + slope() * (light - x / n); }
};

// H(0) and the means from all solids and waves.
void set_level(const Line& line, Spectrum& spectrum) {
  if (line.n == 0.0) return;
  spectrum.mean_light = line.x / line.n;
  spectrum.mean_sample = line.y / line.n;
  if (!line.known()) return;
  spectrum.level = line.slope();
  spectrum.level_sd = 1.0 / std::sqrt(line.spread());
}

}  // namespace

PhasorMeter::PhasorMeter(const WaveMonitor& monitor, const Shot& black) : monitor_(monitor), black_(black) {
  for (const Wave& wave : monitor.waves)
    solvers_.push_back(solver_of(wave, std::vector<bool>(wave.shots.size(), true), false));
}

PhasorMeter::Solver PhasorMeter::solver_of(const Wave& wave, const std::vector<bool>& used, bool mean_known) {
  Solver solver{.row = std::vector<std::array<double, 3>>(wave.shots.size() + 1), .covariance = {}};
  const auto basis = [&](size_t i) {
    if (i == wave.shots.size()) return Eigen::Vector3d(1.0, 0.0, 0.0);
    return Eigen::Vector3d(1.0, std::cos(wave.phase_rad[i]), std::sin(wave.phase_rad[i]));
  };
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  double count = 0.0;
  const auto is_used = [&](size_t i) { return i < used.size() ? used[i] : mean_known; };
  for (size_t i = 0; i <= used.size(); ++i) {
    if (!is_used(i)) continue;
    normal += basis(i) * basis(i).transpose();
    count += 1.0;
  }
  // Equally spaced phases give diag(n, n/2, n/2); close phases make it nearly singular.
  if (!(normal.determinant() > 1e-3 * count * count * count)) return solver;
  solver.solvable = true;
  const Eigen::Matrix3d inverse = normal.inverse();
  for (size_t k = 0; k < 3; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    solver.covariance[k] = inverse(row, row);
    for (size_t i = 0; i <= used.size(); ++i) {
      if (is_used(i)) solver.row[i][k] = inverse.row(row).dot(basis(i));
    }
  }
  return solver;
}

void PhasorMeter::measure(const FrameStack& stack, size_t index, int channel, const SampleNoise& noise,
                          Spectrum& spectrum) const {
  const size_t c = channel;
  spectrum = {.phasors = std::move(spectrum.phasors), .bars = std::move(spectrum.bars)};
  spectrum.phasors.assign(monitor_.waves.size(), {});
  Line line;
  const auto add_solid = [&](const Shot& shot, double light) {
    if (shot.empty()) return;
    const MergedSample sample = merge(stack, shot, index, noise);
    spectrum.saturated = spectrum.saturated || sample.saturated;
    if (!sample.saturated) line.add(light, sample.radiance, sample.variance);
  };
  std::vector<MergedSample> samples;
  std::vector<bool> used;
  const auto load = [&](const Wave& wave) {
    samples.clear();
    used.clear();
    for (const Shot& shot : wave.shots) {
      samples.push_back(merge(stack, shot, index, noise));
      used.push_back(!samples.back().saturated);
    }
    return std::ranges::find(used, false) == used.end();
  };
  // Equal weights: weights from noisy samples would favour samples that noise made darker.
  const auto solve = [&](size_t w, const Solver& solver, double mean) {
    const Wave& wave = monitor_.waves[w];
    std::array<double, 3> found{};
    for (size_t k = 0; k < 3; ++k) found[k] = solver.row[samples.size()][k] * mean;
    double variance = 0.0, count = 0.0;
    for (size_t i = 0; i < samples.size(); ++i) {
      if (!used[i]) continue;
      for (size_t k = 0; k < 3; ++k) found[k] += solver.row[i][k] * samples[i].radiance;
      variance += samples[i].variance;
      count += 1.0;
    }
    variance /= count;
    const double scale = 2.0 / wave.peak[c];
    spectrum.phasors[w] = {
        .value = {scale * found[1], scale * found[2]},
        .sd = scale * std::sqrt(0.5 * variance * (solver.covariance[1] + solver.covariance[2]))};
    return MergedSample{.radiance = found[0], .variance = variance * solver.covariance[0]};
  };
  for (const Solid& solid : monitor_.solids) add_solid(solid.shot, solid.light[c]);
  add_solid(black_, 0.0);
  const bool coded = !monitor_.bars[0].empty() || !monitor_.bars[1].empty();
  std::vector<size_t> cut;
  for (size_t w = 0; w < monitor_.waves.size(); ++w) {
    const Wave& wave = monitor_.waves[w];
    if (!(wave.peak[c] > 0.0)) continue;
    if (!load(wave)) {
      cut.push_back(w);
      continue;
    }
    const MergedSample mean = solve(w, solvers_[w], 0.0);
    // Beside bars, solids tell it: other people's displays are seldom linear.
    if (!coded || !line.known()) line.add(0.5 * wave.peak[c], mean.radiance, mean.variance);
    for (size_t i = 0; i < samples.size(); ++i) {
      const std::complex<double> turn = std::polar(0.5 * wave.peak[c], -wave.phase_rad[i]);
      const double left = samples[i].radiance - mean.radiance - std::real(spectrum.phasors[w].value * turn);
      spectrum.residual += left * left;
    }
    spectrum.degrees += static_cast<int>(samples.size()) - 3;
  }
  for (const size_t w : cut) {
    const Wave& wave = monitor_.waves[w];
    load(wave);
    const Solver solver = solver_of(wave, used, line.known());
    if (solver.solvable) solve(w, solver, line.known() ? line.at(0.5 * wave.peak[c]) : 0.0);
  }
  spectrum.saturated = spectrum.saturated || !cut.empty();
  set_level(line, spectrum);
  measure_bars(stack, index, c, noise, spectrum);
}

void PhasorMeter::measure_bars(const FrameStack& stack, size_t index, size_t channel,
                               const SampleNoise& noise, Spectrum& spectrum) const {
  const bool level_known = std::isfinite(spectrum.level_sd) && spectrum.level > 0.0;
  for (size_t axis = 0; axis < 2; ++axis) {
    std::vector<BarAnswer>& answers = spectrum.bars[axis];
    answers.assign(monitor_.bars[axis].size(), {});
    for (size_t i = 0; level_known && i < answers.size(); ++i) {
      const Bars& bars = monitor_.bars[axis][i];
      const double range = spectrum.level * bars.light[channel];
      const double dark = spectrum.mean_sample - spectrum.mean_light * spectrum.level;
      if (!(range > 0.0) || bars.lit.empty()) continue;
      const MergedSample lit = merge(stack, bars.lit, index, noise);
      if (bars.complement.empty()) {
        answers[i] = {.value = 2.0 * (lit.radiance - dark) / range - 1.0,
                      .sd = 2.0 * std::sqrt(lit.variance) / range};
      } else {
        const MergedSample complement = merge(stack, bars.complement, index, noise);
        answers[i] = {.value = (lit.radiance - complement.radiance) / range,
                      .sd = std::sqrt(lit.variance + complement.variance) / range};
      }
      answers[i].value = std::clamp(answers[i].value, -1.0, 1.0);
    }
  }
}

}  // namespace glasswing
