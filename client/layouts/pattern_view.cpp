#include "client/layouts/pattern_view.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <numeric>

namespace glasswing {
namespace {

constexpr float kMinRange = 8.0f / 255.0f;
constexpr float kMinShareOfRange = 0.25f;
constexpr int kReach_px = 2;  // an edge is blurred by no more
constexpr size_t kSpan = 2 * kReach_px + 1;
constexpr size_t kFew = 10;  // photographs, of which none is passed over
constexpr size_t kPhases = 40;
constexpr size_t kGathered_px = 2500;  // of an axis are enough for fringes
constexpr float kSure = 0.3f;  // a bar's value differs from the edge's by this much of white minus black

float percentile(std::vector<float>& values, double share) {
  if (values.empty()) return 0.0f;
  const auto place = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, place);
  return *place;
}

struct Range {
  std::vector<float> low, high;
};

// A tenth of the photographs may be darker or lighter.
Range range_of(const SampledLines& lines) {
  const size_t count = lines.codes.size(), passed_over = count < kFew ? 0 : (count + 5) / 10;
  Range range;
  std::vector<float> codes(count);
  for (size_t i = 0; i < lines.size(); ++i) {
    for (size_t k = 0; k < count; ++k) codes[k] = lines.codes[k][i];
    const auto low = codes.begin() + passed_over,
               high = codes.end() - 1 - static_cast<std::ptrdiff_t>(passed_over);
    std::ranges::nth_element(codes, low);
    range.low.push_back(*low);
    std::ranges::nth_element(codes, high);
    range.high.push_back(*high);
  }
  return range;
}

}  // namespace

PatternView::PatternView(const StackSamples& samples) {
  lines_[0].values = samples.rows;
  lines_[1].values = samples.columns;
  const std::array<Range, 2> ranges{range_of(samples.rows), range_of(samples.columns)};
  std::vector<float> spans;
  for (size_t i = 0; i < ranges[0].low.size(); ++i) spans.push_back(ranges[0].high[i] - ranges[0].low[i]);
  const float threshold = std::max(kMinRange, kMinShareOfRange * percentile(spans, 0.99));
  for (size_t axis = 0; axis < 2; ++axis) {
    const Range& range = ranges[axis];
    for (size_t i = 0; i < range.low.size(); ++i)
      lines_[axis].lit.push_back(range.high[i] - range.low[i] > threshold ? 1 : 0);
    for (std::vector<float>& codes : lines_[axis].values.codes) {
      for (size_t i = 0; i < codes.size(); ++i)
        codes[i] = (codes[i] - range.low[i]) / std::max(range.high[i] - range.low[i], 1e-6f);
    }
  }
  const std::vector<char>& lit = lines_[0].lit;
  lit_share_ = static_cast<double>(std::ranges::count(lit, 1)) / static_cast<double>(lit.size());
  for (size_t i = 0; i < samples.rows.codes.size(); ++i) looks_.push_back(look_at(i));
  for (size_t axis = 0; axis < 2; ++axis) gather(axis);
  correlate();
}

PatternView::Look PatternView::look_at(size_t photograph) const {
  Look look;
  std::vector<float> seen;
  for (const Lines& lines : lines_) {
    for (size_t i = 0; i < lines.values.size(); ++i) {
      if (lines.lit[i] != 0) seen.push_back(lines.values.codes[photograph][i]);
    }
  }
  look.low = percentile(seen, 0.05);
  look.high = percentile(seen, 0.95);
  const double quarter = 0.25 * (look.high - look.low);
  const auto between =
      std::ranges::count_if(seen, [&](float v) { return v > look.low + quarter && v < look.high - quarter; });
  look.between = static_cast<double>(between) / std::max(1.0, static_cast<double>(seen.size()));
  const double dark = look.low + 1.5 * quarter, light = look.high - 1.5 * quarter;
  for (size_t axis = 0; axis < 2; ++axis) {
    const std::vector<float>& values = lines_[axis].values.codes[photograph];
    const size_t length = lines_[axis].values.length_px;
    double edges = 0.0, places = 0.0, lines = 0.0;
    int side = 0;  // the last clear value's: -1 dark, 1 light
    size_t line = lines_[axis].values.size();
    for (size_t i = 0; i < values.size(); ++i) {
      if (i % length == 0) side = 0;
      if (lines_[axis].lit[i] == 0) continue;
      if (i / length != line) lines += 1.0;
      line = i / length;
      places += 1.0;
      const int now = values[i] < dark ? -1 : values[i] > light ? 1 : 0;
      if (now * side < 0) edges += 1.0;
      if (now != 0) side = now;
    }
    look.edges[axis] = edges / std::max(lines, 1.0);
    look.density[axis] = edges / std::max(places, 1.0);
  }
  return look;
}

double PatternView::own_value(const Lines& lines, int photograph, size_t at) const {
  const Look& seen = look(photograph);
  const double v = lines.values.codes[photograph][at];
  const double range = seen.high - seen.low;
  return std::clamp(range < kMinContrast ? v : (v - seen.low) / range, 0.0, 1.0);
}

double PatternView::complement_error(int a, int b) const {
  double sum = 0.0, count = 0.0;
  for (const Lines& lines : lines_) {
    for (size_t i = 0; i < lines.lit.size(); ++i) {
      if (lines.lit[i] == 0) continue;
      sum += std::abs(own_value(lines, a, i) + own_value(lines, b, i) - 1.0);
      count += 1.0;
    }
  }
  return sum / std::max(count, 1.0);
}

// Lit bars are positive, dark ones negative, -1 to 1.
float PatternView::value(const Lines& lines, const BarShots& shots, size_t at) const {
  const double lit = own_value(lines, shots.lit, at);
  if (shots.complement < 0) return static_cast<float>(2.0 * lit - 1.0);
  return static_cast<float>(lit - own_value(lines, shots.complement, at));
}

int PatternView::edge_at(const Lines& lines, const BarShots& bars, size_t from) const {
  const size_t to = from + kSpan;  // the edge lies between the two places in the middle
  if (std::any_of(&lines.lit[from], &lines.lit[to] + 1, [](char lit) { return lit == 0; })) return 0;
  const float near = value(lines, bars, from + kReach_px), far = value(lines, bars, to - kReach_px);
  if (near * far > 0.0f) return 0;
  const float before = value(lines, bars, from), after = value(lines, bars, to);
  if (before * after > 0.0f || std::min(std::abs(before), std::abs(after)) < kSure) return 0;
  return after > before ? 1 : -1;
}

PatternView::EdgeCounts PatternView::edges(const BarShots& coarse, const BarShots& fine, size_t axis) const {
  const Lines& lines = lines_[axis];
  const size_t length = lines.values.length_px;
  EdgeCounts counts;
  for (size_t start = 0; start < lines.values.size(); start += length) {
    for (size_t from = start; from + kSpan < start + length; ++from) {
      const int edge = edge_at(lines, coarse, from);
      if (edge == 0) continue;
      (edge > 0 ? counts.rising : counts.falling) += 1;
      const float before = value(lines, fine, from), after = value(lines, fine, from + kSpan);
      if (std::min(std::abs(before), std::abs(after)) < kSure) continue;
      if (before * after < 0.0f) {
        ++counts.also_edge;
      } else {
        ++(before > 0.0f ? counts.lit : counts.dark);
      }
    }
  }
  return counts;
}

std::vector<std::complex<double>> PatternView::phasors(const Lines& lines, int first, int steps) const {
  std::vector<std::complex<double>> phasors(lines.values.size());
  for (int k = 0; k < steps; ++k) {
    const std::complex<double> turn = std::polar(2.0 / steps, 2.0 * std::numbers::pi * k / steps);
    const std::vector<float>& values = lines.values.codes[first + k];
    for (size_t i = 0; i < phasors.size(); ++i) {
      if (lines.lit[i] != 0) phasors[i] += static_cast<double>(values[i]) * turn;
    }
  }
  return phasors;
}

PatternView::EdgePhases PatternView::phases_at_edges(const BarShots& bars, int first, int steps,
                                                     size_t axis) const {
  const Lines& lines = lines_[axis];
  const std::vector<std::complex<double>> wave = phasors(lines, first, steps);
  const size_t length = lines.values.length_px;
  EdgePhases phases;
  for (size_t start = 0; start < lines.values.size(); start += length) {
    for (size_t from = start; from + kSpan < start + length; ++from) {
      if (edge_at(lines, bars, from) == 0) continue;
      const std::complex<double> both = wave[from + kReach_px] + wave[from + kReach_px + 1];
      if (std::abs(both) < 1e-6) continue;
      const std::complex<double> phase = both / std::abs(both);
      phases.once += phase;
      phases.twice += phase * phase;
      ++phases.count;
    }
  }
  phases.once /= std::max(phases.count, 1);
  phases.twice /= std::max(phases.count, 1);
  return phases;
}

double PatternView::beat_rad(int first, int other, int steps, size_t axis) const {
  const std::vector<std::complex<double>> one = phasors(lines_[axis], first, steps),
                                          two = phasors(lines_[axis], other, steps);
  const size_t length = lines_[axis].values.length_px;
  std::complex<double> turn;
  for (size_t i = 0; i + 1 < one.size(); ++i) {
    if ((i + 1) % length != 0)
      turn += std::conj(one[i] * std::conj(two[i])) * one[i + 1] * std::conj(two[i + 1]);
  }
  return std::arg(turn);
}

namespace {

// Mean, cosine and sine of a wave by its samples, by least squares over the steps that count.
struct WaveRows {
  std::array<std::vector<double>, 3> fit;
  std::vector<double> cosine, sine;
};
WaveRows wave_rows(int steps, int left_out) {
  WaveRows rows;
  Eigen::Matrix<double, Eigen::Dynamic, 3> design(steps, 3);
  for (int k = 0; k < steps; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / steps;
    rows.cosine.push_back(std::cos(angle));
    rows.sine.push_back(std::sin(angle));
    design.row(k) << 1.0, rows.cosine.back(), rows.sine.back();
    if (k == left_out) design.row(k).setZero();
  }
  const Eigen::Matrix<double, 3, Eigen::Dynamic> fit =
      (design.transpose() * design).ldlt().solve(design.transpose());
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (int k = 0; k < steps; ++k) rows.fit[row].push_back(fit(row, k));
  }
  return rows;
}

}  // namespace

void PatternView::gather(size_t axis) {
  const Lines& lines = lines_[axis];
  const size_t length = lines.values.length_px;
  std::vector<std::pair<std::ptrdiff_t, size_t>> by_light;
  for (size_t start = 0; start < lines.values.size(); start += length)
    by_light.emplace_back(-std::count(&lines.lit[start], &lines.lit[start] + length, 1), start);
  std::ranges::sort(by_light);
  Gathered& gathered = gathered_[axis];
  for (const auto& [minus_lit, start] : by_light) {
    if (gathered.follows.size() > kGathered_px) break;
    for (size_t i = start; i < start + length; ++i) {
      if (lines.lit[i] == 0) continue;
      gathered.follows.push_back(i > start && lines.lit[i - 1] != 0 ? 1 : 0);
      for (const std::vector<float>& codes : lines.values.codes) gathered.values.push_back(codes[i]);
    }
  }
}

void PatternView::correlate() {
  const Gathered& gathered = gathered_[0];
  const size_t photographs = looks_.size();
  const auto count = static_cast<double>(std::max<size_t>(gathered.follows.size(), 1));
  std::vector<double> means(photographs);
  for (size_t i = 0; i < gathered.values.size(); ++i)
    means[i % photographs] += static_cast<double>(gathered.values[i]) / count;
  covariances_.resize(photographs);
  for (size_t a = 0; a < photographs; ++a) {
    for (size_t d = 0; d < std::min(kNear, photographs - a); ++d) {
      double sum = 0.0;
      for (size_t at = a; at < gathered.values.size(); at += photographs)
        sum += static_cast<double>(gathered.values[at]) * static_cast<double>(gathered.values[at + d]);
      covariances_[a][d] = sum / count - means[a] * means[a + d];
    }
  }
}

double PatternView::covariance(int a, int b) const {
  return covariances_[std::min(a, b)][std::abs(a - b)];
}

PatternView::Fringe PatternView::fringe(int first, int steps, int left_out) const {
  Fringe fringe;
  const WaveRows rows = wave_rows(steps, left_out);
  const double used = left_out < 0 ? steps : steps - 1;
  std::array<double, kPhases> phases{};
  double unexplained = 0.0, modulated = 0.0, count = 0.0, means = 0.0, squares = 0.0, sizes = 0.0,
         powers = 0.0;
  for (size_t axis = 0; axis < 2; ++axis) {
    std::complex<double> turn, before;
    double aligned = 0.0;
    const float* sample = gathered_[axis].values.data() + first;
    for (const char follows : gathered_[axis].follows) {
      double energy = 0.0, sum = 0.0, cosines = 0.0, sines = 0.0;
      std::array<double, 3> fit{};
      for (int k = 0; k < steps; ++k) {
        if (k == left_out) continue;
        const double u = sample[k];
        for (size_t row = 0; row < 3; ++row) fit[row] += u * rows.fit[row][k];
        energy += u * u;
        sum += u;
        cosines += u * rows.cosine[k];
        sines += u * rows.sine[k];
      }
      // Of least squares, the fit's energy is its product with the samples.
      const double explained = fit[0] * sum + fit[1] * cosines + fit[2] * sines;
      unexplained += std::max(0.0, energy - explained);
      modulated += energy - sum * sum / used;
      const std::complex<double> phasor(fit[1], fit[2]);
      if (follows != 0) {
        turn += std::conj(before) * phasor;
        aligned += std::abs(before) * std::abs(phasor);
      }
      before = phasor;
      const double turns = std::arg(phasor) / (2.0 * std::numbers::pi) + 0.5;
      phases[std::min(static_cast<size_t>(turns * kPhases), kPhases - 1)] += 1.0;
      count += 1.0;
      means += fit[0];
      squares += fit[0] * fit[0];
      sizes += std::abs(phasor);
      powers += std::norm(phasor);
      sample += looks_.size();
    }
    fringe.turn_rad[axis] = std::arg(turn);
    fringe.coherence[axis] = std::abs(turn) / std::max(aligned, 1e-12);
  }
  count = std::max(count, 1.0);
  const auto spread = [count](double sum, double square) {
    return std::sqrt(std::max(0.0, square / count - sum * sum / (count * count)));
  };
  std::ranges::sort(phases, std::greater());
  fringe.few_phases = std::accumulate(phases.begin(), phases.begin() + kPhases / 10, 0.0) / count;
  fringe.least_sum = 1.0;
  double least = 1e9, most = 1e-9;
  for (int k = 0; k < steps; ++k) {
    if (k == left_out) continue;
    const int a = first + k, b = first + (k + 1) % steps;
    least = std::min(least, covariance(a, a));
    most = std::max(most, covariance(a, a));
    if ((k + 1) % steps == left_out) continue;
    const double both = covariance(a, a) + covariance(b, b);
    fringe.least_sum = std::min(fringe.least_sum, 1.0 + 2.0 * covariance(a, b) / std::max(both, 1e-12));
  }
  fringe.least_variance = least / most;
  fringe.residual = unexplained / std::max(modulated, 1e-12);
  fringe.mean_spread = spread(means, squares);
  fringe.amplitude = sizes / count;
  fringe.amplitude_spread = spread(sizes, powers) / std::max(sizes / count, 1e-12);
  return fringe;
}

}  // namespace glasswing
