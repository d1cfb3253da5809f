#include "solver/mixture/mixture_solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/median.h"
#include "core/footprint/seen_part.h"
#include "solver/method/clipped_noise.h"

namespace glasswing {
namespace {

constexpr double kLeastNoise = 1e-4;          // the shape of pixels and footprints leaves as much
constexpr int kRounds = 3;                    // of reweighting white and bars, and samples clipped at black
constexpr int kPolish = 20;                   // steps of a round
constexpr double kQuarterOfNormal = 0.31864;  // of |x|, in standard deviations
constexpr int kNoiseFits = 9;                 // pixels of a row, of one channel each
constexpr double kPoorFit = 0.1;              // of the strongest weight: rms of the residual
constexpr double kLeastLight = 1e-4;          // of a mode, on the monitor

bool is_finite(const Footprint& mode) {
  return std::isfinite(mode.weight + mode.x_px + mode.y_px + mode.xx_px2 + mode.xy_px2 + mode.yy_px2);
}

// Changes so small that white and bars would get the same weights as before.
bool stayed(const Footprints& before, const Footprints& after) {
  constexpr double kShare = 0.02;
  for (int m = 0; m < after.size(); ++m) {
    const Footprint &a = before[m], &b = after[m];
    const double wide_px2 = b.xx_px2 + b.yy_px2 + kFlatPixel_px2;
    if (std::abs(a.weight - b.weight) > kShare * b.weight ||
        std::pow(a.x_px - b.x_px, 2.0) + std::pow(a.y_px - b.y_px, 2.0) > kShare * wide_px2 ||
        std::abs(a.xx_px2 - b.xx_px2) + std::abs(a.yy_px2 - b.yy_px2) > 5.0 * kShare * wide_px2)
      return false;
  }
  return true;
}

}  // namespace

MixtureTables::MixtureTables(const MixtureLayout& layout) {
  for (const MixtureMonitor& monitor : layout.monitors) {
    answers.emplace_back(monitor.patterns, monitor.extent);
    dictionaries.emplace_back(patterns.emplace_back(answers.back()));
  }
}

MixtureSolver::MixtureSolver(const FrameStack& stack, const MixtureLayout& layout,
                             const MixtureTables& tables, int max_modes, double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      tables_(tables),
      max_modes_(max_modes),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      noise_(surroundings_.noise()),
      last_(layout.monitors.size()) {
  for (const FootprintDictionary& dictionary : tables.dictionaries)
    searches_.emplace_back(dictionary, max_modes_);
}

void MixtureSolver::solve_row(int y, Matte& matte) {
  std::vector<double> read_sd;
  if (!surroundings_.noise_known()) {
    noise_ = {.read_sd = layout_.wave_noise.known() ? layout_.wave_noise.of_row(stack_, y)
                                                    : std::min(noise_of_pairs(y), noise_of_fits(y)),
              .gain = 0.0};
    read_sd.assign(stack_.width_px, noise_.read_sd);
  }
  const SettledRow row = surroundings_.settle_row(y, read_sd, matte);
  for (auto& channels : last_) channels.fill({});
  for (int x = 0; x < stack_.width_px; ++x) {
    const size_t i = x;
    if (!row.object[i] && !row.open[i]) {
      for (auto& channels : last_) channels.fill({});
      continue;
    }
    for (const int channel : stack_.channels(x, y)) {
      std::ranges::fill(matte.modes(x, y, channel), Mode{});
      solve_channel(x, y, channel, matte);
    }
  }
}

double MixtureSolver::noise_of_pairs(int y) const {
  std::vector<double> off;
  for (const StageLayout::Pair& pair : layout_.stage.pairs) {
    for (int x = 0; x < stack_.width_px; ++x) {
      for (const int channel : stack_.channels(x, y)) {
        const size_t index = stack_.sample_index(x, y, channel);
        const double object = merge(stack_, pair.object, index, noise_).radiance,
                     empty = merge(stack_, pair.empty, index, noise_).radiance;
        // Samples clipped at black have less noise.
        if (object > 0.0 && empty > 0.0) off.push_back(std::abs(object - empty));
      }
    }
  }
  if (off.empty()) return surroundings_.noise().read_sd;
  const auto quarter = off.begin() + std::ssize(off) / 4;
  std::ranges::nth_element(off, quarter);
  return std::max(*quarter / (kQuarterOfNormal * std::numbers::sqrt2), kLeastNoise);
}

double MixtureSolver::noise_of_fits(int y) {
  noise_ = {.read_sd = 0.0, .gain = 0.0};
  std::vector<double> left;
  for (int i = 0; i < kNoiseFits; ++i) {
    const int x = (2 * i + 1) * stack_.width_px / (2 * kNoiseFits);
    const ChannelRange channels = stack_.channels(x, y);
    load(0, x, y, channels.first + i % channels.size());
    left.push_back(noise_left(solve(0, {})));
  }
  return kLeastNoise * std::sqrt(std::max(median(std::move(left)), 1.0));
}

void MixtureSolver::load(size_t m, int x, int y, int channel) {
  const MixtureMonitor& monitor = layout_.monitors[m];
  const auto count = std::ssize(monitor.shots);
  const size_t index = stack_.sample_index(x, y, channel);
  samples_.patterns = &tables_.patterns[m];
  for (Eigen::VectorXd* const all : {&samples_.y, &samples_.weight, &samples_.peak, &seen_, &variance_})
    all->resize(count + 1);
  saturated_ = clipped_ = false;
  for (Eigen::Index i = 0; i <= count; ++i) {
    const size_t at = i;
    const MergedSample merged =
        merge(stack_, i < count ? monitor.shots[at] : layout_.stage.black, index, noise_);
    seen_[i] = merged.radiance;
    variance_[i] = merged.variance + kLeastNoise * kLeastNoise;
    samples_.peak[i] = i < count ? monitor.peaks[at][channel] : 0.0;
    if (merged.saturated) {
      variance_[i] = INFINITY;
      // White shows only that the weight is 1.
      saturated_ = saturated_ || i == count || monitor.patterns[at].kind != ShownPattern::Kind::kArea;
    }
    clipped_ = clipped_ || merged.radiance <= 0.0;
  }
  samples_.y = seen_;
  samples_.weight = variance_.cwiseInverse();
}

void MixtureSolver::reweigh(size_t m, const Footprints& modes, double floor) {
  const MixtureMonitor& monitor = layout_.monitors[m];
  const std::vector<double> model = model_of(samples_, modes, true);
  for (Eigen::Index i = 0; i < samples_.size(); ++i) {
    const double own = model[i];
    if (seen_[i] <= 0.0 && std::isfinite(variance_[i])) {
      const double sd = std::sqrt(variance_[i]), light = std::max(floor + own, 0.0);
      samples_.y[i] = light + sd * mean_noise_below(light / sd);
    }
    if (i + 1 == samples_.size()) continue;
    const ShownPattern& pattern = monitor.patterns[i];
    if (pattern.kind != ShownPattern::Kind::kArea) continue;
    double off = (pattern.lit.bars ? kBarsError : kWhiteError) * own;
    for (const Footprint& mode : modes)
      off += samples_.peak[i] * mode.weight * lit_share_error(mode, pattern.lit, monitor.extent);
    samples_.weight[i] = 1.0 / (variance_[i] + off * off);
  }
}

double MixtureSolver::noise_left(const MixtureFit& fit) const {
  return fit.chi2 / std::max(static_cast<double>(samples_.size()) - 1.0 - 6.0 * fit.modes.size(), 1.0);
}

MixtureFit MixtureSolver::solve(size_t m, std::span<const Footprints> neighbours) {
  const MixtureSearch& search = searches_[m];
  // Edges of bars would constrain a footprint's shape too much.
  for (Eigen::Index i = 0; i + 1 < samples_.size(); ++i) {
    const ShownPattern& pattern = layout_.monitors[m].patterns[i];
    if (pattern.kind == ShownPattern::Kind::kArea && pattern.lit.bars) {
      const double off = 0.05 * samples_.peak[i];
      samples_.weight[i] = 1.0 / (variance_[i] + off * off);
    }
  }
  MixtureFit fit = search.run(samples_, neighbours);
  if (fit.modes.empty()) return fit;
  for (int round = 0; round < kRounds; ++round) {
    reweigh(m, fit.modes, fit.floor);
    const MixtureFit next = fit_mixture(MixtureLanes(samples_), fit.modes, true, kPolish);
    const bool settled =
        stayed(fit.modes, next.modes) || (round > 0 && std::abs(next.chi2 - fit.chi2) < 0.01 * next.chi2);
    fit = next;
    if (!settled) continue;
    // Along flat valleys, where several modes share light, steps continue that change nothing visible.
    fit.converged = true;
    break;
  }
  find_errors(MixtureLanes(samples_), fit);
  return fit;
}

void MixtureSolver::solve_channel(int x, int y, int channel, Matte& matte) {
  std::uint8_t flags = matte.flags(x, y);
  const size_t c = channel;
  std::vector<Mode> found;
  double foreground = 0.0;
  bool usable = false;
  for (size_t m = 0; m < layout_.monitors.size(); ++m) {
    load(m, x, y, channel);
    if (saturated_) flags |= kFlagSaturated;
    usable = usable || (samples_.weight.array() > 0.0).count() > kMinPatterns;
    std::vector<Footprints> neighbours;
    for (int other = 0; other < kChannels; ++other) neighbours.push_back(last_[m][other]);
    const MixtureFit fit = solve(m, neighbours);
    foreground += fit.floor / static_cast<double>(layout_.monitors.size());
    double strongest = 0.0;
    for (int k = 0; k < fit.modes.size(); ++k) {
      const size_t i = k;
      if (!is_finite(fit.modes[k])) {
        flags |= kFlagNotConverged;
        continue;
      }
      // A mode beyond the monitor changes no sample, so its light is arbitrary.
      if (!(seen_part(fit.modes[k], layout_.monitors[m].extent).weight > kLeastLight)) continue;
      strongest = std::max(strongest, fit.modes[k].weight);
      // Residuals beyond noise make everything less certain.
      const double excess = std::sqrt(std::max(noise_left(fit), 1.0));
      found.push_back(mode_of(fit.modes[k], excess * fit.weight_sd[i], excess * fit.centre_sd_px[i],
                              layout_.monitors[m].texture));
    }
    if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
    const double information = samples_.weight.sum();
    const double rms = std::sqrt(fit.chi2 / information),
                 noise = std::sqrt(static_cast<double>(samples_.size()) / information);
    if (rms > std::max(4.0 * noise, kPoorFit * strongest)) flags |= kFlagPoorFit;
    last_[m][c] = fit.modes;
  }
  if (!usable) flags |= kFlagNoData;
  matte.foreground(x, y)[c] = static_cast<float>(foreground);
  std::ranges::stable_sort(found, std::greater<>(), &Mode::weight);
  const std::span<Mode> modes = matte.modes(x, y, channel);
  if (found.size() > modes.size()) flags |= kFlagPoorFit;
  std::copy_n(found.begin(), std::min(found.size(), modes.size()), modes.begin());
  matte.flags(x, y) = flags;
}

}  // namespace glasswing
