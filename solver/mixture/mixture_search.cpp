#include "solver/mixture/mixture_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kPointsAPeriod = 5.0;  // of the finest sinusoid, or of as much as a stripe is wide
constexpr double kMaxPoints = 64.0;     // along the longer side
constexpr double kWide[] = {1.0 / 20.0, 1.0 / 7.0};  // sigmas of wide footprints, of the longer side
constexpr int kFirstSteps = 2, kFurther = 3, kFurtherSteps = 6, kSteps = 60;

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

FootprintDictionary::FootprintDictionary(const PatternAnswers& answers) {
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
  const Eigen::Index n = answers.size() + 1;
  answers_.setZero(n, std::ssize(footprints_));
  Eigen::MatrixXd columns(n, PatternAnswers::kColumns);
  for (size_t i = 0; i < footprints_.size(); ++i) {
    columns.setZero();
    answers.of(footprints_[i], false, columns.data(), n);
    answers_.col(static_cast<Eigen::Index>(i)) = columns.col(0).cast<float>();
  }
}

void FootprintDictionary::weigh(const MixtureSamples& samples, Norms& norms) const {
  const Eigen::VectorXf weight = samples.weight.cast<float>(), peak = samples.peak.cast<float>();
  if (norms.weight.size() == weight.size() && norms.weight == weight && norms.peak == peak) return;
  norms.weight = weight;
  norms.peak = peak;
  const Eigen::VectorXf once = (weight.array() * peak.array()).matrix(),
                        twice = (weight.array() * peak.array().square()).matrix();
  norms.sums = answers_.transpose() * once;
  norms.squares.resize(answers_.cols());
  for (Eigen::Index i = 0; i < answers_.cols(); ++i)
    norms.squares[i] = (answers_.col(i).array().square() * twice.array()).sum();
  norms.squares.array() -= norms.sums.array().square() / weight.sum();
}

Footprint FootprintDictionary::best(const MixtureSamples& samples, const Eigen::VectorXd& residual,
                                    const Norms& norms) const {
  const Eigen::VectorXf wanted =
      (samples.weight.array() * samples.peak.array() * residual.array()).matrix().cast<float>();
  const Eigen::VectorXf both = answers_.transpose() * wanted;
  float most = 0.0f;
  Eigen::Index best = -1;
  for (Eigen::Index i = 0; i < both.size(); ++i) {
    if (!(norms.squares[i] > 0.0f) || both[i] <= 0.0f) continue;
    const float gain = both[i] * both[i] / norms.squares[i];
    if (gain > most) most = gain, best = i;
  }
  if (best < 0) return {};
  Footprint found = footprints_[static_cast<size_t>(best)];
  found.weight = static_cast<double>(both[best] / norms.squares[best]);
  return found;
}

bool MixtureSearch::explains(const MixtureFit& fit, Eigen::Index samples) {
  const double degrees = std::max(static_cast<double>(samples) - 1.0 - 6.0 * fit.modes.size(), 1.0);
  return fit.chi2 < degrees + 1.0 * std::sqrt(2.0 * degrees);
}

Footprints MixtureSearch::with_best(const MixtureSamples& samples, Footprints modes) {
  double floor = 0.0;
  residual_of(samples, modes, false, workspace_, &floor);
  const Footprint found = dictionary_.best(samples, workspace_.residual, norms_);
  if (found.weight > 0.0) modes.push_back(found);
  return modes;
}

void MixtureSearch::add_splits(const Footprints& modes, std::vector<Footprints>& starts) {
  // The two brightest modes, along both axes of Sigma.
  for (int m = 0; m < std::min(modes.size(), 2); ++m) {
    const Footprint& whole = modes[m];
    const double mean = 0.5 * (whole.xx_px2 + whole.yy_px2), half = 0.5 * (whole.xx_px2 - whole.yy_px2);
    const double radius = std::hypot(half, whole.xy_px2);
    for (const bool longer : {true, false}) {
      const double angle = 0.5 * std::atan2(whole.xy_px2, half) + (longer ? 0.0 : 0.5 * std::numbers::pi);
      const double ax = std::cos(angle), ay = std::sin(angle);
      const double variance = std::max(mean + (longer ? radius : -radius), 0.05);
      const double shift = 0.8 * std::sqrt(variance), less = 0.6 * variance;
      Footprint part = whole;
      part.weight *= 0.5;
      part.xx_px2 -= less * ax * ax;
      part.xy_px2 -= less * ax * ay;
      part.yy_px2 -= less * ay * ay;
      part = with_positive_covariance(part, 0.05);
      Footprint other = part;
      part.x_px += shift * ax, part.y_px += shift * ay;
      other.x_px -= shift * ax, other.y_px -= shift * ay;
      Footprints split = modes;
      split[m] = part;
      split.push_back(other);
      starts.push_back(split);
    }
  }
}

MixtureFit MixtureSearch::best_of(const MixtureSamples& samples, int size,
                                  std::span<const Footprints> starts) {
  std::vector<MixtureFit> fits;
  for (const Footprints& start : starts) {
    if (start.size() == size) fits.push_back(fit_mixture(samples, start, false, kFirstSteps, workspace_));
  }
  if (fits.empty()) return {};
  // The best few get further steps, and the best of these all that it needs.
  const auto go_on = [&](std::ptrdiff_t count, int steps) {
    count = std::min(count, std::ssize(fits));
    std::ranges::partial_sort(fits, fits.begin() + count, {}, &MixtureFit::chi2);
    for (MixtureFit& fit : std::span(fits).first(static_cast<size_t>(count))) {
      if (!fit.converged) fit = fit_mixture(samples, fit.modes, false, steps, workspace_);
    }
  };
  go_on(kFurther, kFurtherSteps);
  go_on(1, kSteps);
  return fits.front();
}

MixtureFit MixtureSearch::run(const MixtureSamples& samples, std::span<const Footprints> neighbours) {
  dictionary_.weigh(samples, norms_);
  const double n = static_cast<double>(samples.size());
  MixtureFit best;
  best.chi2 = residual_of(samples, {}, false, workspace_, &best.floor);
  best.converged = true;
  Footprints pursued;
  std::vector<Footprints> starts;
  while (best.modes.size() < max_modes_ && !explains(best, samples.size())) {
    const int size = best.modes.size() + 1;
    starts.assign(1, with_best(samples, best.modes));
    // From the dictionary alone: where two places are wanted, one mode may have settled between them.
    if (size > 1) {
      pursued = with_best(samples, pursued);
      starts.push_back(pursued);
    } else {
      pursued = starts.front();
    }
    for (const Footprints& neighbour : neighbours) starts.push_back(neighbour);
    add_splits(best.modes, starts);
    MixtureFit next = best_of(samples, size, starts);
    if (next.modes.empty() || !(light_of(next.modes) > 0.0)) break;
    sort(next);
    const double before = std::max(best.chi2, n), after = std::max(next.chi2, n);
    if (!(n * std::log(before / after) > 4.0 * std::log(n))) break;
    best = next;
  }
  return best;
}

}  // namespace glasswing
