#include "solver/mixture/mixture_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kPointsAPeriod = 5.0;               // of the finest sinusoid, or of a stripe's width
constexpr double kMaxPoints = 64.0;                  // along the longer side
constexpr double kWide[] = {1.0 / 20.0, 1.0 / 7.0};  // sigmas of wide footprints, of the longer side
constexpr int kFirstSteps = 2, kFurther = 3, kFurtherSteps = 6, kSteps = 60;
constexpr int kNearSteps = 8;  // from a neighbour's footprints
constexpr double kNearEnough =
    0.5;                    // whether they explain the samples is judged then; MixtureSolver continues
constexpr int kSplits = 2;  // of the strongest modes

// The period of the finest pattern.
double finest_px(const PatternAnswers& answers) {
  double finest = std::max(answers.extent().width_px, answers.extent().height_px);
  for (const ShownPattern& pattern : answers.patterns()) {
    if (pattern.kind == ShownPattern::Kind::kWave)
      finest = std::min(finest, 1.0 / std::hypot(pattern.fx, pattern.fy));
    // A stripe's spectrum falls to a seventh at a period of pi sigma.
    if (pattern.kind == ShownPattern::Kind::kStripe)
      finest = std::min(finest, std::numbers::pi * pattern.axis.sigma_px);
  }
  return finest;
}

double light_of(const Footprints& modes) {
  double light = 0.0;
  for (const Footprint& mode : modes) light += mode.weight;
  return light;
}

// Of chi2 over what noise leaves, in standard deviations.
double excess(const MixtureFit& fit, int samples) {
  const double degrees = std::max(samples - 1.0 - 6.0 * fit.modes.size(), 1.0);
  return (fit.chi2 - degrees) / std::sqrt(2.0 * degrees);
}

bool nearly_explains(const MixtureFit& fit, int samples) {
  return excess(fit, samples) < 3.0;
}

// Whether one more mode lowers n log chi2 by 4 log n, where noise alone leaves n.
bool earns_its_place(double before, double after, int samples) {
  const double n = samples;
  return n * std::log(std::max(before, n) / std::max(after, n)) > 4.0 * std::log(n);
}

// Puts the strongest mode first.
void sort(MixtureFit& fit) {
  for (int i = 0; i < fit.modes.size(); ++i) {
    int strongest = i;
    for (int m = i + 1; m < fit.modes.size(); ++m) {
      if (fit.modes[m].weight > fit.modes[strongest].weight) strongest = m;
    }
    std::swap(fit.modes[i], fit.modes[strongest]);
  }
}

}  // namespace

FootprintDictionary::FootprintDictionary(const PatternLanes& patterns) : patterns_(patterns) {
  const PatternAnswers& answers = patterns.answers();
  const MonitorExtent& extent = answers.extent();
  const double side = std::max(extent.width_px, extent.height_px);
  const auto add_grid = [&](double step_px, double sigma_px) {
    for (double y = 0.5 * step_px; y < extent.height_px; y += step_px) {
      for (double x = 0.5 * step_px; x < extent.width_px; x += step_px) {
        footprints_.push_back({.weight = 1.0,
                               .x_px = x,
                               .y_px = y,
                               .xx_px2 = sigma_px * sigma_px,
                               .xy_px2 = 0.0,
                               .yy_px2 = sigma_px * sigma_px});
      }
    }
  };
  const double step_px = std::max(finest_px(answers) / kPointsAPeriod, side / kMaxPoints);
  add_grid(step_px, step_px / std::sqrt(12.0));
  for (const double wide : kWide) {
    if (wide * side > 2.0 * step_px) add_grid(wide * side, wide * side);
  }
  const size_t count = footprints_.size();
  stride_ = (count + internal::kTogether - 1) / internal::kTogether * internal::kTogether;
  answers_.resize(patterns.pattern_count() * stride_);
  const std::vector<float> ones(patterns.size(), 1.0f);
  std::vector<float> columns(PatternLanes::kColumns * patterns.size());
  for (size_t i = 0; i < count; ++i) {
    patterns.answer(footprints_[i], false, ones.data(), columns.data());
    for (size_t p = 0; p < patterns.pattern_count(); ++p)
      answers_[p * stride_ + i] = columns[patterns.lane(p)];
  }
}

FootprintDictionary::Norms FootprintDictionary::norms(const MixtureLanes& samples) const {
  std::vector<float> first(patterns_.pattern_count()), second(first);
  for (size_t p = 0; p < first.size(); ++p) {
    const size_t k = patterns_.lane(p);
    first[p] = samples.root[k] * samples.peak[k];
    second[p] = samples.peak[k] * samples.peak[k];
  }
  Norms norms{.sums = std::vector<float>(stride_), .squares = std::vector<float>(stride_)};
  internal::weigh(answers_.data(), first, second, stride_, norms.sums.data(), norms.squares.data());
  const auto share = static_cast<float>(1.0 / samples.information);
  for (size_t i = 0; i < stride_; ++i) norms.squares[i] -= share * norms.sums[i] * norms.sums[i];
  return norms;
}

Footprint FootprintDictionary::best(const MixtureLanes& samples, const Residual& residual,
                                    const Norms& norms) const {
  std::vector<float> wanted(patterns_.pattern_count()), both(stride_);
  for (size_t p = 0; p < wanted.size(); ++p) {
    const size_t k = patterns_.lane(p);
    wanted[p] = samples.peak[k] * residual.lanes[k];
  }
  internal::correlate(answers_.data(), wanted, stride_, both.data());
  float most = 0.0f;
  size_t best = stride_;
  for (size_t i = 0; i < footprints_.size(); ++i) {
    if (!(norms.squares[i] > 0.0f) || both[i] <= 0.0f) continue;
    const float gain = both[i] * both[i] / norms.squares[i];
    if (gain > most) most = gain, best = i;
  }
  if (best == stride_) return {};
  Footprint found = footprints_[best];
  found.weight = static_cast<double>(both[best] / norms.squares[best]);
  return found;
}

bool MixtureSearch::explains(const MixtureFit& fit, int samples) {
  return excess(fit, samples) < 1.0;
}

Footprints MixtureSearch::with_best(const MixtureLanes& samples, const FootprintDictionary::Norms& norms,
                                    Footprints modes) const {
  const Footprint found = dictionary_.best(samples, residual_of(samples, modes, false), norms);
  if (found.weight > 0.0) modes.push_back(found);
  return modes;
}

MixtureFit MixtureSearch::best_of(const MixtureLanes& samples, int size,
                                  std::span<const Footprints> starts) const {
  std::vector<MixtureFit> fits;
  for (const Footprints& start : starts) {
    if (start.size() == size) fits.push_back(fit_mixture(samples, start, false, kFirstSteps));
  }
  if (fits.empty()) return {};
  // The best few get more steps, and the best of these as many as it needs.
  const auto go_on = [&](std::ptrdiff_t count, int steps) {
    count = std::min(count, std::ssize(fits));
    std::ranges::partial_sort(fits, fits.begin() + count, {}, &MixtureFit::chi2);
    for (MixtureFit& fit : std::span(fits).first(count)) {
      if (!fit.converged) fit = fit_mixture(samples, fit.modes, false, steps);
    }
  };
  go_on(kFurther, kFurtherSteps);
  go_on(1, kSteps);
  return fits.front();
}

MixtureFit MixtureSearch::run(const MixtureSamples& samples, std::span<const Footprints> neighbours) const {
  const MixtureLanes lanes(samples);
  const Footprints* likeliest = nullptr;
  double least = INFINITY;
  for (const Footprints& own : neighbours) {
    if (own.empty() || own.size() > max_modes_) continue;
    const double chi2 = residual_of(lanes, own, false).chi2;
    if (chi2 < least) least = chi2, likeliest = &own;
  }
  MixtureFit near;
  if (likeliest != nullptr) {
    near = fit_mixture(lanes, *likeliest, false, kNearSteps, kNearEnough);
    if (explains(near, lanes.count)) return fewest(lanes, near);
  }
  const FootprintDictionary::Norms norms = dictionary_.norms(lanes);
  if (likeliest != nullptr && near.modes.size() < max_modes_) {
    // Beyond an edge of the object's surface the pixel sees another place.
    const MixtureFit other = fit_mixture(lanes, with_best(lanes, norms, {}), false, kNearSteps, kNearEnough);
    if (explains(other, lanes.count)) return other;
    if (!earns_its_place(near.chi2, 0.0, lanes.count) && nearly_explains(near, lanes.count))
      return fewest(lanes, near);
    // On the edge, it sees one more.
    const MixtureFit more =
        fit_mixture(lanes, with_best(lanes, norms, near.modes), false, kNearSteps, kNearEnough);
    const bool earned = earns_its_place(near.chi2, more.chi2, lanes.count);
    if (earned && explains(more, lanes.count)) return fewest(lanes, more);
    if (!earned && nearly_explains(near, lanes.count)) return fewest(lanes, near);
  }
  return search(lanes, norms, neighbours);
}

MixtureFit MixtureSearch::fewest(const MixtureLanes& samples, MixtureFit fit) const {
  sort(fit);
  while (fit.modes.size() > 1) {
    Footprints fewer = fit.modes;
    fewer.remove(fewer.size() - 1);
    MixtureFit next = fit_mixture(samples, fewer, false, kNearSteps, kNearEnough);
    if (!(excess(next, samples.count) < 1.0)) break;
    sort(next);
    fit = next;
  }
  return fit;
}

MixtureFit MixtureSearch::search(const MixtureLanes& samples, const FootprintDictionary::Norms& norms,
                                 std::span<const Footprints> neighbours) const {
  const Residual empty = residual_of(samples, {}, false);
  MixtureFit best{.modes = {}, .chi2 = empty.chi2, .floor = empty.floor, .converged = true};
  Footprints pursued;
  std::vector<Footprints> starts;
  while (best.modes.size() < max_modes_ && !explains(best, samples.count) &&
         earns_its_place(best.chi2, 0.0, samples.count)) {
    const int size = best.modes.size() + 1;
    starts.assign(1, with_best(samples, norms, best.modes));
    // From the dictionary alone: if there are two places, one mode may have settled between them.
    if (size > 1) {
      pursued = with_best(samples, norms, pursued);
      starts.push_back(pursued);
    } else {
      pursued = starts.front();
    }
    for (const Footprints& neighbour : neighbours) starts.push_back(neighbour);
    for (int m = 0; m < std::min(best.modes.size(), kSplits); ++m) {
      for (const SplitAxis axis : {SplitAxis::kWide, SplitAxis::kNarrow}) {
        const auto [half, other] = split(best.modes[m], axis);
        Footprints& start = starts.emplace_back(best.modes);
        start[m] = half;
        start.push_back(other);
      }
    }
    MixtureFit next = best_of(samples, size, starts);
    if (next.modes.empty() || !(light_of(next.modes) > 0.0)) break;
    sort(next);
    if (!earns_its_place(best.chi2, next.chi2, samples.count)) break;
    best = next;
  }
  return best;
}

}  // namespace glasswing
