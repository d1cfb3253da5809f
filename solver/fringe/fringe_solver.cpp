#include "solver/fringe/fringe_solver.h"

#include <algorithm>
#include <cmath>

#include "core/footprint/wave_answer.h"

namespace glasswing {
namespace {

constexpr double kFalsePositiveRate = 1e-4;
constexpr int kMinDegrees = 4;  // for an estimate of a pixel's noise
constexpr double kMaxVeil = 0.25;

Mode mode_of(const SpectrumFit& fit, int m, int texture, double share = 1.0) {
  Footprint footprint = fit.modes[m];
  footprint.weight *= share;
  const size_t i = m;
  return glasswing::mode_of(footprint, share * fit.weight_sd[i], fit.centre_sd_px[i], texture);
}

// The mean of the channels.
Spectrum mean_of(const std::array<Spectrum, kChannels>& spectra) {
  Spectrum mean = spectra[0];
  const auto pool = [](double a, double b) { return std::hypot(a, b); };
  for (size_t c = 1; c < kChannels; ++c) {
    for (size_t w = 0; w < mean.phasors.size(); ++w) {
      mean.phasors[w].value += spectra[c].phasors[w].value;
      mean.phasors[w].sd = pool(mean.phasors[w].sd, spectra[c].phasors[w].sd);
    }
    mean.level += spectra[c].level;
    mean.level_sd = pool(mean.level_sd, spectra[c].level_sd);
  }
  for (Phasor& phasor : mean.phasors) {
    phasor.value /= static_cast<double>(kChannels);
    phasor.sd /= kChannels;
  }
  mean.level /= kChannels;
  mean.level_sd /= kChannels;
  return mean;
}

// The multiple of `whole` in `part`, by least squares.
double share_of(const Spectrum& part, const Spectrum& whole) {
  double both = 0.0, square = 0.0;
  for (size_t w = 0; w < whole.phasors.size(); ++w) {
    if (!std::isfinite(whole.phasors[w].sd)) continue;
    const double information = 1.0 / (whole.phasors[w].sd * whole.phasors[w].sd);
    both += information * std::real(std::conj(whole.phasors[w].value) * part.phasors[w].value);
    square += information * std::norm(whole.phasors[w].value);
  }
  if (std::isfinite(whole.level_sd)) {
    both += whole.level * part.level / (whole.level_sd * whole.level_sd);
    square += whole.level * whole.level / (whole.level_sd * whole.level_sd);
  }
  return square > 0.0 ? std::max(both / square, 0.0) : 0.0;
}

}  // namespace

FringeSolver::FringeSolver(const FrameStack& stack, const FringeLayout& layout, int max_modes,
                           double tolerance, double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      max_modes_(max_modes),
      tolerance_(tolerance),
      surroundings_(stack, layout.stage, silhouette_tolerance) {
  for (const WaveMonitor& monitor : layout.object)
    object_.emplace_back(monitor, layout.stage.black, tolerance, max_modes > 1);
  for (const WaveMonitor& monitor : layout.empty)
    empty_.emplace_back(monitor, layout.empty_black, tolerance, false);
  for (const EmptyMonitor& monitor : layout.stage.monitors)
    bars_ = bars_ || !monitor.bars[0].empty() || !monitor.bars[1].empty();
  size_t most = 0;
  for (const WaveMonitor& monitor : layout.object) most = std::max(most, monitor.waves.size());
  for (const WaveMonitor& monitor : layout.empty) most = std::max(most, monitor.waves.size());
  thresholds_.push_back(0.0);
  for (size_t degrees = 1; degrees <= 2 * most + 1; ++degrees)
    thresholds_.push_back(chi_square_quantile(static_cast<double>(degrees), kFalsePositiveRate));
}

bool FringeSolver::exceeds(double chi_square, const SpectrumFit& fit) const {
  return fit.degrees > 0 && chi_square > thresholds_[fit.degrees];
}

void FringeSolver::estimate_row_noise(int y) {
  const SampleNoise& usual = surroundings_.noise();
  const double min_sd = sample_noise(layout_.stage.camera, 0.0).read_sd;
  read_sd_.resize(stack_.width_px);
  for (size_t x = 0; x < read_sd_.size(); ++x) {
    double squares = 0.0;
    int degrees = 0;
    for (const Monitor& monitor : object_) {
      for (int c = 0; c < kChannels; ++c) {
        monitor.meter.measure(stack_, stack_.sample_index(static_cast<int>(x), y, c), c, usual, spectrum_);
        squares += spectrum_.residual;
        degrees += spectrum_.degrees;
      }
    }
    read_sd_[x] = degrees < kMinDegrees ? usual.read_sd : std::max(std::sqrt(squares / degrees), min_sd);
  }
}

void FringeSolver::solve_row(int y, Matte& matte) {
  if (!surroundings_.noise_known()) estimate_row_noise(y);
  const std::vector<bool> object = surroundings_.settle_row(y, read_sd_, matte).object;
  for (int x = 0; x < matte.width_px(); ++x) {
    if (matte.flags(x, y) & kFlagNoData) continue;
    SampleNoise noise = surroundings_.noise();
    if (!read_sd_.empty()) noise = {.read_sd = read_sd_[x], .gain = 0.0};
    if (object[x]) {
      solve_pixel(x, y, noise, matte);
    } else if (!bars_ && !empty_.empty()) {
      map_background(x, y, noise, matte);
    }
  }
}

bool FringeSolver::earns_its_place(const SpectrumFit& before, const SpectrumFit& after) {
  return after.closely < 0.5 * before.closely;
}

SpectrumFit FringeSolver::fit_veiled(const Monitor& monitor, const Spectrum& spectrum, const Unwrapped& place,
                                     const Footprints& start) const {
  if (!std::isfinite(spectrum.level_sd)) return {};
  Spectrum waves = spectrum;
  waves.level_sd = kUnknown;
  SpectrumFit fit = monitor.fitter.fit(waves, place.used, start, kMaxFitSteps);
  Footprint& mode = fit.modes[0];
  const double seen = answer_of(mode, 0.0, 0.0, monitor.layout->extent).value.real();
  const double veil = spectrum.level - seen;
  if (exceeds(fit.tolerated, fit) || !(veil > 0.0 && veil < kMaxVeil * spectrum.level)) return {};
  mode.weight *= spectrum.level / seen;
  fit.weight_sd[0] = spectrum.level_sd * mode.weight / spectrum.level;
  return fit;
}

FringeSolver::Found FringeSolver::find(const Monitor& monitor, const Spectrum& all, int max_modes) const {
  Found found;
  double most = all.level, min_sd = all.level_sd;
  if (!std::isfinite(all.level_sd)) {
    for (const Phasor& phasor : all.phasors) {
      if (std::abs(phasor.value) <= most) continue;
      most = std::abs(phasor.value);
      min_sd = phasor.sd;
    }
  }
  if (!(most > kWrongPeriod * min_sd)) return found;
  const Unwrapped place = unwrap(*monitor.layout, all, tolerance_);
  Spectrum spectrum = all;
  for (size_t w = 0; w < spectrum.phasors.size(); ++w) {
    if (place.superseded[w]) spectrum.phasors[w].sd = kUnknown;
  }
  if (!place.found) {
    found.flags = kFlagNoData;
    return found;
  }
  Footprints start;
  start.push_back(monitor.fitter.guess(spectrum, place));
  found.fit = monitor.fitter.fit(spectrum, place.used, start, kMaxFitSteps);
  while (exceeds(found.fit.closely, found.fit) && found.fit.modes.size() < max_modes) {
    const SpectrumFit more = monitor.fitter.fit_one_more(spectrum, found.fit);
    if (more.modes.empty() || more.degrees < 1 || !earns_its_place(found.fit, more)) break;
    found.fit = more;
  }
  if (exceeds(found.fit.tolerated, found.fit) && found.fit.modes.size() == 1) {
    const SpectrumFit veiled = fit_veiled(monitor, spectrum, place, start);
    if (!veiled.modes.empty() && veiled.tolerated < 0.25 * found.fit.tolerated) found.fit = veiled;
  }
  for (int m = 0; m < found.fit.modes.size(); ++m) {
    double& sd_px = found.fit.centre_sd_px[m];
    sd_px = std::hypot(sd_px, place.disagreement_px);
  }
  if (!found.fit.converged) found.flags |= kFlagNotConverged;
  if (exceeds(found.fit.tolerated, found.fit)) found.flags |= kFlagPoorFit;
  return found;
}

void FringeSolver::solve_pixel(int x, int y, const SampleNoise& noise, Matte& matte) {
  for (int c = 0; c < kChannels; ++c) {
    const std::span<Mode> modes = matte.modes(x, y, c);
    double foreground = 0.0;
    size_t slot = 0;
    for (const Monitor& monitor : object_) {
      monitor.meter.measure(stack_, stack_.sample_index(x, y, c), c, noise, spectrum_);
      if (spectrum_.saturated) matte.flags(x, y) |= kFlagSaturated;
      const Found found = find(monitor, spectrum_, max_modes_);
      matte.flags(x, y) |= found.flags;
      double light = 0.0;
      for (int m = 0; m < found.fit.modes.size(); ++m) {
        modes[slot++] = mode_of(found.fit, m, monitor.layout->texture);
        light += answer_of(found.fit.modes[m], 0.0, 0.0, monitor.layout->extent).value.real();
      }
      foreground +=
          (spectrum_.mean_sample - spectrum_.mean_light * light) / static_cast<double>(object_.size());
    }
    if (layout_.stage.black.empty())
      matte.foreground(x, y)[c] = static_cast<float>(std::max(foreground, 0.0));
  }
}

void FringeSolver::map_background(int x, int y, const SampleNoise& noise, Matte& matte) {
  for (int c = 0; c < kChannels; ++c) std::ranges::fill(matte.modes(x, y, c), Mode{});
  size_t slot = 0;
  for (const Monitor& monitor : empty_) {
    for (int c = 0; c < kChannels; ++c)
      monitor.meter.measure(stack_, stack_.sample_index(x, y, c), c, noise, spectra_[c]);
    const Spectrum mean = mean_of(spectra_);
    const Found found = find(monitor, mean, 1);
    if (found.fit.modes.empty() || slot == matte.modes(x, y, 0).size()) continue;
    matte.flags(x, y) |= found.flags;
    for (int c = 0; c < kChannels; ++c) {
      const double share = share_of(spectra_[c], mean);
      matte.modes(x, y, c)[slot] = mode_of(found.fit, 0, monitor.layout->texture, share);
    }
    ++slot;
  }
}

}  // namespace glasswing
