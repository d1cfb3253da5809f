#include "solver/background/bar_decoder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kMinSigma_px = 0.02;
// A symmetric footprint keeps the sign of the bar that contains its centre. Only a camera's box of more than
// two bars can flip it, by at most 1/3: a wave beyond this is trusted, a weaker one only weighted.
constexpr double kClear = 0.5;
constexpr size_t kMaxIntervals = 8;
constexpr double kLogSigmaSd = 0.5;    // standard deviation of the guess of ln sigma
constexpr double kCentreShare = 0.25;  // and of the centre, as a share of the monitor
// A footprint clipped by the edge looks like a whole one with less weight further inside: prefer the whole
// one.
constexpr double kOutsideSd = 0.1;
// The model error of symmetric footprints of another shape: of v, at least this, and of the centre as a share
// of the finest bar.
constexpr double kShapeCentre = 0.1;
constexpr double kThreeSd = 9.0;
constexpr double kMinGain = 1e-3;  // of chi-square
constexpr double kAll = std::numeric_limits<double>::infinity();

// The normal distribution within 6 sd by cubic Hermite interpolation: accurate to 2e-8 and ten times as fast
// as erfc and exp.
class NormalTable {
 public:
  struct Value {
    double cumulative, density;
  };
  NormalTable() {
    for (size_t i = 0; i < nodes_.size(); ++i) {
      const double z = static_cast<double>(i) * kStep - kReach;
      nodes_[i] = {0.5 * std::erfc(-z / std::numbers::sqrt2),
                   std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi)};
    }
  }
  Value at(double z) const {
    if (z <= -kReach) return {0.0, 0.0};
    if (z >= kReach) return {1.0, 0.0};
    const double place = (z + kReach) / kStep;
    const auto i = static_cast<size_t>(place);
    const double t = place - static_cast<double>(i);
    const Value &a = nodes_[i], &b = nodes_[i + 1];
    const double rise = b.cumulative - a.cumulative;
    const double slope_a = kStep * a.density, slope_b = kStep * b.density;
    const double third = slope_a + slope_b - 2.0 * rise, second = rise - slope_a - third;
    return {a.cumulative + t * (slope_a + t * (second + t * third)),
            (slope_a + t * (2.0 * second + 3.0 * t * third)) / kStep};
  }

  static constexpr double kReach = 6.0;

 private:
  static constexpr double kStep = 1.0 / 16.0;
  std::array<Value, 194> nodes_{};
};

const NormalTable& normal() {
  static const NormalTable table;
  return table;
}

// z with cumulative(z) = p, for p in [1/2, 1): Abramowitz and Stegun 26.2.23, accurate to 5e-4, which is
// enough for a starting value.
double upper_quantile(double p) {
  const double t = std::sqrt(-2.0 * std::log(std::max(1.0 - p, 1e-12)));
  return t -
         (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
}

double sign_of(size_t bar) {
  return bar % 2 == 0 ? 1.0 : -1.0;
}

}  // namespace

BarDecoder::BarDecoder(std::span<const double> bar_widths_px, int extent_px) : extent_px_(extent_px) {
  assert(extent_px >= 1);
  for (const double bar_px : bar_widths_px) {
    assert(bar_px >= 1.0 && (waves_.empty() || bar_px < waves_.back().bar_px));
    Wave wave{.bar_px = bar_px, .regular = bar_px == std::floor(bar_px), .edges_px = {0.0}};
    for (int i = 1; i <= extent_px; ++i) {
      const bool lit_before = std::fmod(std::floor((i - 0.5) / bar_px), 2.0) == 0.0;
      const bool lit = std::fmod(std::floor((i + 0.5) / bar_px), 2.0) == 0.0;
      if (lit == lit_before && i < extent_px) continue;
      const double sign = sign_of(wave.edges_px.size() - 1);
      wave.sum_px += sign * (i - wave.edges_px.back());
      wave.edges_px.push_back(i);
    }
    waves_.push_back(std::move(wave));
  }
}

size_t BarDecoder::Wave::bar_at(double t_px) const {
  const auto above = std::upper_bound(edges_px.begin() + 1, edges_px.end() - 1, t_px);
  return static_cast<size_t>(above - edges_px.begin()) - 1;
}

// v = N / Z. N starts as if the centre's bar covered everything and subtracts twice the part past each edge,
// with alternating signs; edges more than 6 sigma away change nothing.
BarDecoder::Value BarDecoder::value(size_t place, double centre_px, double sigma_px) const {
  const Wave& wave = waves_[place];
  const NormalTable& table = normal();
  const double per_px = 1.0 / sigma_px;
  const double z_low = -centre_px * per_px, z_high = (extent_px_ - centre_px) * per_px;
  const auto [p_low, g_low] = table.at(z_low);
  const auto [p_high, g_high] = table.at(z_high);
  const double z = std::max(p_high - p_low, 1e-12);
  const double z_by_centre = (g_low - g_high) * per_px;
  const double z_by_log_sigma = z_low * g_low - z_high * g_high;
  double n = 0.0, n_by_centre = 0.0, n_by_log_sigma = 0.0;
  if (wave.regular && sigma_px > 2.5 * wave.bar_px) {
    // Bars far narrower than the footprint cancel except at the monitor's ends: integrate by parts with the
    // mean of the wave's primitive, half a bar.
    const double low = 0.5 * wave.bar_px * per_px;
    const double high = (wave.sum_px - 0.5 * wave.bar_px) * per_px;
    n = low * g_low + high * g_high;
    n_by_centre = (low * g_low * z_low + high * g_high * z_high) * per_px;
    n_by_log_sigma = low * g_low * (z_low * z_low - 1.0) + high * g_high * (z_high * z_high - 1.0);
  } else {
    const size_t bar = wave.bar_at(centre_px);
    const double sign = sign_of(bar);
    n = sign * z;
    n_by_centre = sign * z_by_centre;
    n_by_log_sigma = sign * z_by_log_sigma;
    double flip = -2.0 * sign;
    for (size_t j = bar + 1; j + 1 < wave.edges_px.size(); ++j, flip = -flip) {
      const double z_edge = (wave.edges_px[j] - centre_px) * per_px;
      if (z_edge > NormalTable::kReach) break;
      const auto [p, g] = table.at(z_edge);
      n += flip * (p_high - p);
      n_by_centre += flip * (g - g_high) * per_px;
      n_by_log_sigma += flip * (z_edge * g - z_high * g_high);
    }
    flip = -2.0 * sign;
    for (size_t j = bar; j > 0; --j, flip = -flip) {
      const double z_edge = (wave.edges_px[j] - centre_px) * per_px;
      if (z_edge < -NormalTable::kReach) break;
      const auto [p, g] = table.at(z_edge);
      n += flip * (p - p_low);
      n_by_centre += flip * (g_low - g) * per_px;
      n_by_log_sigma += flip * (z_low * g_low - z_edge * g);
    }
  }
  const double v = n / z;
  return {.v = v,
          .by_centre = (n_by_centre - v * z_by_centre) / z,
          .by_log_sigma = (n_by_log_sigma - v * z_by_log_sigma) / z};
}

double BarDecoder::shown_sigma_px(double variance_px2) {
  return std::max(std::sqrt(std::max(variance_px2, 0.0)), kMinSigma_px);
}

BarDecoder::Value BarDecoder::inside(double centre_px, double sigma_px) const {
  const double z_low = -centre_px / sigma_px, z_high = (extent_px_ - centre_px) / sigma_px;
  const auto [p_low, g_low] = normal().at(z_low);
  const auto [p_high, g_high] = normal().at(z_high);
  return {.v = p_high - p_low,
          .by_centre = (g_low - g_high) / sigma_px,
          .by_log_sigma = z_low * g_low - z_high * g_high};
}

double BarDecoder::cost(const Problem& problem, double centre_px, double sigma_px, double enough) const {
  const double off_centre = (centre_px - problem.guess.centre_px) / (kCentreShare * extent_px_);
  const double off_sigma = std::log(sigma_px / problem.guess.sigma_px) / kLogSigmaSd;
  const double outside = (1.0 - inside(centre_px, sigma_px).v) / kOutsideSd;
  double sum = off_centre * off_centre + off_sigma * off_sigma + outside * outside;
  for (size_t i = waves_.size(); i-- > 0 && sum < enough;) {  // fine waves contribute most
    const Sample& sample = problem.samples[i];
    const double residual = (value(i, centre_px, sigma_px).v - sample.value) / sample.sd;
    sum += residual * residual;
  }
  return sum;
}

// The bars that all clear waves agree on, coarse to fine, nearest to the guess first. *stopped: the first
// unclear wave, whose edge lies in view or which is finer than the footprint.
std::vector<BarDecoder::Interval> BarDecoder::descend(const Problem& problem, size_t* stopped) const {
  const Guess& guess = problem.guess;
  std::vector<Interval> intervals{{0.0, extent_px_}};
  for (*stopped = 0; *stopped < waves_.size(); ++*stopped) {
    const double v = problem.samples[*stopped].value;
    if (std::abs(v) < kClear) break;
    const Wave& wave = waves_[*stopped];
    std::vector<Interval> narrower;
    for (const Interval& interval : intervals) {
      for (size_t bar = wave.bar_at(interval.low_px); bar + 1 < wave.edges_px.size(); ++bar) {
        if (wave.edges_px[bar] >= interval.high_px) break;
        if (sign_of(bar) * v < 0.0) continue;
        const Interval both{std::max(interval.low_px, wave.edges_px[bar]),
                            std::min(interval.high_px, wave.edges_px[bar + 1])};
        if (both.high_px > both.low_px) narrower.push_back(both);
      }
    }
    // No bar remains: the waves contradict each other. Keep the previous ones.
    if (narrower.empty()) break;
    const auto distance = [&guess](const Interval& interval) {
      return std::abs(std::clamp(guess.centre_px, interval.low_px, interval.high_px) - guess.centre_px);
    };
    std::ranges::sort(narrower, {}, distance);
    if (narrower.size() > kMaxIntervals) narrower.resize(kMaxIntervals);
    intervals = std::move(narrower);
  }
  return intervals;
}

std::vector<BarDecoder::Start> BarDecoder::starts(const Problem& problem) const {
  const Guess& guess = problem.guess;
  size_t stopped = 0;
  const std::vector<Interval> intervals = descend(problem, &stopped);
  const bool all_clear = stopped == waves_.size();
  const size_t last = all_clear ? stopped - 1 : stopped;
  const Wave& wave = waves_[last];
  const double v = std::clamp(problem.samples[last].value, -1.0, 1.0);
  // A footprint of this sigma at this distance from an edge gives |v|.
  const double z = upper_quantile(0.5 + 0.5 * std::min(std::abs(v), 0.999));
  std::vector<Start> result;
  for (const Interval& interval : intervals) {
    const auto add = [&](double centre_px, double sigma_px) {
      result.push_back({.centre_px = std::clamp(centre_px, interval.low_px, interval.high_px),
                        .sigma_px = sigma_px,
                        .cost = 0.0});
    };
    const double middle_px = 0.5 * (interval.low_px + interval.high_px);
    for (double sigma_px = 0.5 * guess.sigma_px; sigma_px < wave.bar_px; sigma_px *= 2.0) {
      const double offset_px = std::min(z * sigma_px, 0.5 * wave.bar_px);
      if (all_clear) {
        add(interval.low_px + offset_px, sigma_px);
        add(interval.high_px - offset_px, sigma_px);
        continue;
      }
      for (size_t j = wave.bar_at(interval.low_px); j < wave.edges_px.size(); ++j) {
        const double edge_px = wave.edges_px[j];
        if (edge_px > interval.high_px) break;
        if (edge_px < interval.low_px || j == 0 || j + 1 == wave.edges_px.size()) continue;
        const double lit_side = sign_of(j);
        add(edge_px + (v >= 0.0 ? lit_side : -lit_side) * offset_px, sigma_px);
      }
    }
    if (all_clear) continue;
    add(middle_px, guess.sigma_px);
    // Wider than the bars: anywhere within the range left by the coarser waves.
    const double step_px = std::max(0.5 * wave.bar_px, 0.125 * (interval.high_px - interval.low_px));
    for (double centre_px = interval.low_px + 0.5 * step_px; centre_px < interval.high_px;
         centre_px += step_px) {
      add(centre_px, 0.5 * wave.bar_px);
      add(centre_px, wave.bar_px);
    }
  }
  // Finally the guess itself, moved into the range of the clear waves.
  const Interval& nearest = intervals.front();
  const double keep_px = 0.02 * (nearest.high_px - nearest.low_px);
  result.push_back(
      {.centre_px = std::clamp(guess.centre_px, nearest.low_px + keep_px, nearest.high_px - keep_px),
       .sigma_px = guess.sigma_px,
       .cost = 0.0});
  return result;
}

// Gradient and Gauss-Newton matrix of half the cost, negated gradient.
struct BarDecoder::Normal {
  double d_c = 0.0, d_s = 0.0;
  double cc = 0.0, cs = 0.0, ss = 0.0;
  void add(double residual, double by_centre, double by_log_sigma, double sd) {
    const double weight = 1.0 / (sd * sd);
    d_c += weight * residual * by_centre;
    d_s += weight * residual * by_log_sigma;
    cc += weight * by_centre * by_centre;
    cs += weight * by_centre * by_log_sigma;
    ss += weight * by_log_sigma * by_log_sigma;
  }
};

BarDecoder::Normal BarDecoder::normal_at(const Problem& problem, double centre_px, double sigma_px) const {
  Normal sum;
  sum.add(problem.guess.centre_px - centre_px, 1.0, 0.0, kCentreShare * extent_px_);
  sum.add(std::log(problem.guess.sigma_px / sigma_px), 0.0, 1.0, kLogSigmaSd);
  const Value whole = inside(centre_px, sigma_px);
  sum.add(1.0 - whole.v, whole.by_centre, whole.by_log_sigma, kOutsideSd);
  for (size_t i = 0; i < waves_.size(); ++i) {
    const Value model = value(i, centre_px, sigma_px);
    const Sample& sample = problem.samples[i];
    sum.add(sample.value - model.v, model.by_centre, model.by_log_sigma, sample.sd);
  }
  return sum;
}

// Levenberg and Marquardt over c and ln sigma.
AxisFit BarDecoder::refine(const Problem& problem, const Start& start, double* total) const {
  double centre = start.centre_px, log_sigma = std::log(start.sigma_px);
  *total = cost(problem, centre, start.sigma_px, kAll);
  double damping = 1e-3;
  Normal at = normal_at(problem, centre, start.sigma_px);
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double sigma = std::exp(log_sigma);
    const double a = at.cc * (1.0 + damping), b = at.ss * (1.0 + damping);
    const double determinant = a * b - at.cs * at.cs;
    const double by_centre = (b * at.d_c - at.cs * at.d_s) / determinant;
    const double by_log_sigma = (a * at.d_s - at.cs * at.d_c) / determinant;
    const double to_centre =
        std::clamp(centre + std::clamp(by_centre, -2.0 * sigma, 2.0 * sigma), 0.0, extent_px_);
    const double to_log_sigma = std::clamp(log_sigma + std::clamp(by_log_sigma, -1.0, 1.0),
                                           std::log(kMinSigma_px), std::log(extent_px_));
    const double to_cost = cost(problem, to_centre, std::exp(to_log_sigma), *total);
    const double gained = *total - to_cost;
    const bool small =
        std::abs(to_centre - centre) < 1e-4 * sigma && std::abs(to_log_sigma - log_sigma) < 1e-4;
    if (gained > 0.0) {
      centre = to_centre;
      log_sigma = to_log_sigma;
      *total = to_cost;
      damping = std::max(0.1 * damping, 1e-9);
      at = normal_at(problem, centre, std::exp(log_sigma));
      if (gained < kMinGain) break;
    } else {
      damping *= 10.0;
    }
    if (small) break;
  }
  AxisFit fit{.centre_px = centre, .sigma_px = std::exp(log_sigma)};
  const double determinant = std::max(at.cc * at.ss - at.cs * at.cs, 1e-300);
  fit.centre_sd_px = std::min(std::hypot(std::sqrt(at.ss / determinant), kShapeCentre * finest_bar_px()),
                              finest_bar_px() / std::sqrt(12.0));
  fit.log_sigma_sd = std::min(std::sqrt(at.cc / determinant), kLogSigmaSd);
  fit.inside = inside(centre, fit.sigma_px).v;
  for (size_t i = 0; i < waves_.size(); ++i) {
    const Sample& sample = problem.samples[i];
    const double residual = (value(i, centre, fit.sigma_px).v - sample.value) / sample.sd;
    fit.chi_square += residual * residual;
  }
  return fit;
}

AxisFit BarDecoder::fit(std::span<const Sample> samples, const Guess& guess) const {
  assert(samples.size() == waves_.size());
  if (waves_.empty()) {
    return {.centre_px = guess.centre_px,
            .sigma_px = guess.sigma_px,
            .centre_sd_px = kCentreShare * extent_px_,
            .log_sigma_sd = kLogSigmaSd};
  }
  Problem problem{.samples = {samples.begin(), samples.end()}, .guess = guess};
  double min_sd = kAll;
  for (Sample& sample : problem.samples) {
    sample.sd = std::hypot(sample.sd, kShapeSd);
    min_sd = std::min(min_sd, sample.sd);
  }
  std::vector<Start> tried = starts(problem);
  for (Start& start : tried) start.cost = cost(problem, start.centre_px, start.sigma_px, kAll);
  const Start& first = *std::ranges::min_element(tried, {}, &Start::cost);
  double best_cost = 0.0;
  AxisFit best = refine(problem, first, &best_cost);
  // The best start at another position. A wave that is off by more than 0.7 cannot be fixed by refinement.
  const double near_px = std::max(finest_bar_px(), 2.0 * first.sigma_px);
  const Start* second = nullptr;
  for (const Start& start : tried) {
    if (std::abs(start.centre_px - first.centre_px) <= near_px) continue;
    if (second == nullptr || start.cost < second->cost) second = &start;
  }
  // Within a wide bar, noise alone would pull the centre to an edge: keep the guess if it fits equally well.
  if (finest_bar_px() > 4.0 * guess.sigma_px && &first != &tried.back()) {
    double guessed_cost = 0.0;
    const AxisFit guessed = refine(problem, tried.back(), &guessed_cost);
    if (guessed_cost < best_cost + kThreeSd) {
      best = guessed;
      best_cost = guessed_cost;
    }
  }
  if (second == nullptr || second->cost - best_cost > 0.5 / (min_sd * min_sd)) return best;
  double other_cost = 0.0;
  AxisFit other = refine(problem, *second, &other_cost);
  const bool apart =
      std::abs(best.centre_px - other.centre_px) > std::max(finest_bar_px(), best.sigma_px + other.sigma_px);
  const bool close_call = apart && std::abs(best_cost - other_cost) < kThreeSd;
  const auto distance = [&guess](const AxisFit& fit) { return std::abs(fit.centre_px - guess.centre_px); };
  const bool other_wins = close_call ? distance(other) < distance(best) : other_cost < best_cost;
  if (other_wins) best = other;
  best.ambiguous = close_call;
  return best;
}

}  // namespace glasswing
