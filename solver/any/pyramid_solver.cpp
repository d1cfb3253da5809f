#include "solver/any/pyramid_solver.h"

#include <algorithm>
#include <cmath>

#include "core/base/median.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kMinNoise = 1e-4;       // the shape of pixels leaves as much
constexpr double kUnknownNoise = 0.005;  // of cameras whose noise nothing tells
constexpr double kMedianOfNormal = 0.67449;
constexpr double kDetail = 0.002;      // of the highest sample
constexpr double kBeyondNoise = 5.0;   // standard deviations of chi2, and
constexpr double kDoubt = 2.5;         // of a fit of Gaussians, from which on pyramids are tried
constexpr double kCertain = 0.9;       // share of the average from which on Gaussians are left as they are
constexpr double kUnexplained = 0.05;  // of the highest sample, that a fit may leave

// Of a camera that does not say: from second differences of stripes, which are smooth where noise is not.
double noise_of_stripes(const std::vector<ShownPattern>& patterns, const Eigen::VectorXd& y) {
  std::vector<double> off;
  const auto is_next = [&](size_t i) {
    const ShownPattern &a = patterns[i], &b = patterns[i + 1];
    return a.kind == ShownPattern::Kind::kStripe && b.kind == a.kind && a.axis.cos_phi == b.axis.cos_phi &&
           a.axis.sin_phi == b.axis.sin_phi && a.axis.sigma_px == b.axis.sigma_px;
  };
  for (size_t i = 0; i + 2 < patterns.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (is_next(i) && is_next(i + 1)) off.push_back(std::abs(y[k] - 2.0 * y[k + 1] + y[k + 2]));
  }
  return off.empty() ? kUnknownNoise : median(std::move(off)) / (kMedianOfNormal * std::sqrt(6.0));
}

// Of stripes and sinusoids on average; what the fit leaves beyond it makes everything less certain.
double noise_of_fit(const std::vector<ShownPattern>& patterns, const Eigen::VectorXd& weight, double chi2) {
  double information = 0.0, samples = 0.0;
  for (Eigen::Index i = 0; i < std::ssize(patterns); ++i) {
    if (!(weight[i] > 0.0) || patterns[static_cast<size_t>(i)].kind == ShownPattern::Kind::kArea) continue;
    information += weight[i];
    ++samples;
  }
  const double excess = chi2 / static_cast<double>((weight.array() > 0.0).count());
  return std::sqrt(std::max(excess, 1.0) * samples / information);
}

// Whether noise explains what is left.
bool is_explained(double chi2, const Eigen::VectorXd& weight) {
  const auto samples = static_cast<double>((weight.array() > 0.0).count());
  return chi2 < samples + kBeyondNoise * std::sqrt(2.0 * samples);
}

// Whether a fit of Gaussians leaves no more than that: each takes six of the samples' degrees of freedom.
bool is_likely(double chi2, const Eigen::VectorXd& weight, int modes) {
  const double freedom = static_cast<double>((weight.array() > 0.0).count()) - 6.0 * modes - 1.0;
  return chi2 < freedom + kDoubt * std::sqrt(2.0 * freedom);
}

}  // namespace

PyramidSolver::PyramidSolver(const FrameStack& stack, const MixtureLayout& layout,
                             const std::deque<PatternLanes>& patterns, std::vector<PyramidFitter>& fitters)
    : stack_(stack),
      layout_(layout),
      patterns_(patterns),
      fitters_(fitters),
      noise_(sample_noise(layout.stage.camera, 0.0)) {}

void PyramidSolver::refine(int x, int y, Matte& matte) {
  if (!(matte.coverage(x, y) > 0.0f) || (matte.flags(x, y) & kFlagNoData) != 0) return;
  last_.assign(layout_.monitors.size(), {});
  bool explained = true;
  for (const int channel : stack_.channels(x, y)) {
    for (size_t m = 0; m < layout_.monitors.size(); ++m)
      explained = refine(m, x, y, channel, matte) && explained;
  }
  if (explained) matte.flags(x, y) = static_cast<std::uint8_t>(matte.flags(x, y) & ~kFlagPoorFit);
}

bool PyramidSolver::refine(size_t m, int x, int y, int channel, Matte& matte) {
  const MixtureMonitor& monitor = layout_.monitors[m];
  Footprints near;
  std::vector<Coefficient> kept;
  for (const Mode& mode : matte.modes(x, y, channel)) {
    if (mode.weight > 0.0f && mode.texture == monitor.texture && near.size() < kMaxFootprints) {
      const auto index = static_cast<std::int32_t>(&mode - matte.modes(x, y, channel).data());
      kept.push_back({.level = kPyramidLevels + index, .weight = mode.weight});
      near.push_back(footprint_of(mode));
    }
  }
  if (near.empty()) return true;
  const auto count = std::ssize(monitor.shots);
  const size_t index = stack_.sample_index(x, y, channel);
  Eigen::VectorXd seen(count + 1), weight(count + 1), peak = Eigen::VectorXd::Zero(count + 1);
  const auto read = [&](const SampleNoise& noise) {
    for (Eigen::Index i = 0; i <= count; ++i) {
      const MergedSample merged =
          merge(stack_, i < count ? monitor.shots[i] : layout_.stage.black, index, noise);
      seen[i] = merged.radiance;
      if (i < count) peak[i] = monitor.peaks[i][channel];
      double variance = merged.variance + kMinNoise * kMinNoise;
      if (i < count && monitor.patterns[i].kind == ShownPattern::Kind::kArea)
        variance += std::pow((monitor.patterns[i].lit.bars ? kBarsError : kWhiteError) * seen[i], 2);
      weight[i] = merged.saturated ? 0.0 : 1.0 / variance;
    }
  };
  SampleNoise noise = noise_;
  if (noise.read_sd <= 0.0) noise.read_sd = kUnknownNoise;
  read(noise);
  if (noise_.read_sd <= 0.0) {
    noise.read_sd = std::max(noise_of_stripes(monitor.patterns, seen), kMinNoise);
    read(noise);
  }
  // The narrowest Gaussians are wider than some shapes' details.
  const double detail = kDetail * (seen.maxCoeff() - seen[count]);
  weight = (weight.cwiseInverse().array() + detail * detail).inverse();
  const MixtureLanes samples({.patterns = &patterns_[m], .y = seen, .weight = weight, .peak = peak});
  const double of_gaussians = fitters_[m].gaussians_chi2(samples, near);
  const bool poor = (matte.flags(x, y) & kFlagPoorFit) != 0;
  if (!poor && near.size() < kMaxFootprints && is_likely(of_gaussians, weight, near.size())) return true;
  ++fitted_;
  const std::optional<PyramidFit> fit = fitters_[m].fit(samples, near, last_[m]);
  if (!fit) return false;
  last_[m] = fit->coefficients;
  if (fit->gaussian > kCertain || fit->coefficients.empty()) return !poor;
  if (!is_explained(fit->chi2, weight) && fit->chi2 > of_gaussians) return false;
  for (size_t i = 0; i < kept.size(); ++i) kept[i].weight *= static_cast<float>(fit->modes[i]);
  std::erase_if(kept, [](const Coefficient& mode) { return !(mode.weight > 0.0f); });
  kept.insert(kept.end(), fit->coefficients.begin(), fit->coefficients.end());
  const double monitors = static_cast<double>(layout_.monitors.size());
  matte.add_pyramid(
      x, y, channel,
      {.texture = monitor.texture,
       .foreground = static_cast<float>((fit->floor - matte.foreground(x, y)[channel]) / monitors),
       .noise_sd = static_cast<float>(noise_of_fit(monitor.patterns, weight, fit->chi2)),
       .prior_sd = static_cast<float>(fit->prior_sd),
       .coefficients = std::move(kept)});
  return is_explained(fit->chi2, weight) ||
         std::sqrt(fit->chi2 / weight.sum()) < kUnexplained * (seen.maxCoeff() - seen[count]);
}

}  // namespace glasswing
