#include "client/layouts/pattern_view.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace glasswing {
namespace {

constexpr float kMinRange = 8.0f / 255.0f;
constexpr float kMinShareOfRange = 0.25f;
constexpr int kReach_px = 2;   // an edge is blurred by no more
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

Range range_of(const SampledLines& lines) {
  Range range{.low = lines.codes.front(), .high = lines.codes.front()};
  for (const std::vector<float>& codes : lines.codes) {
    for (size_t i = 0; i < codes.size(); ++i) {
      range.low[i] = std::min(range.low[i], codes[i]);
      range.high[i] = std::max(range.high[i], codes[i]);
    }
  }
  return range;
}

bool crosses(float a, float b) {
  return (a > 0.5f) != (b > 0.5f);
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
}

PatternView::Look PatternView::look_at(size_t photograph) const {
  Look look;
  std::vector<float> seen;
  for (size_t axis = 0; axis < 2; ++axis) {
    const std::vector<float>& values = lines_[axis].values.codes[photograph];
    const std::vector<char>& lit = lines_[axis].lit;
    const auto length = static_cast<size_t>(lines_[axis].values.length_px);
    double edges = 0.0, places = 0.0;
    for (size_t i = 0; i < values.size(); ++i) {
      if (lit[i] == 0) continue;
      if (axis == 0) seen.push_back(values[i]);
      if ((i + 1) % length == 0 || lit[i + 1] == 0) continue;
      places += 1.0;
      edges += crosses(values[i], values[i + 1]) ? 1.0 : 0.0;
    }
    look.edges[axis] = edges / std::max(places, 1.0);
  }
  const auto between = std::ranges::count_if(seen, [](float v) { return v > 0.25f && v < 0.75f; });
  look.between = static_cast<double>(between) / std::max(1.0, static_cast<double>(seen.size()));
  look.low = percentile(seen, 0.05);
  look.high = percentile(seen, 0.95);
  return look;
}

double PatternView::edges_of_line(int photograph, size_t axis) const {
  const Lines& lines = lines_[axis];
  const double lit = static_cast<double>(std::ranges::count(lines.lit, 1));
  return look(photograph).edges[axis] * lit / lines.values.count;
}

double PatternView::complement_error(int a, int b) const {
  const std::vector<float>& one = lines_[0].values.codes[static_cast<size_t>(a)];
  const std::vector<float>& other = lines_[0].values.codes[static_cast<size_t>(b)];
  double sum = 0.0, count = 0.0;
  for (size_t i = 0; i < one.size(); ++i) {
    if (lines_[0].lit[i] == 0) continue;
    sum += std::abs(static_cast<double>(one[i] + other[i]) - 1.0);
    count += 1.0;
  }
  return sum / std::max(count, 1.0);
}

// Lit bars are positive, dark ones negative, -1 to 1.
float PatternView::value(const Lines& lines, const BarShots& shots, size_t at) const {
  const float lit = lines.values.codes[static_cast<size_t>(shots.lit)][at];
  if (shots.complement < 0) return 2.0f * lit - 1.0f;
  return lit - lines.values.codes[static_cast<size_t>(shots.complement)][at];
}

PatternView::EdgeCounts PatternView::edges(const BarShots& coarse, const BarShots& fine, size_t axis) const {
  const Lines& lines = lines_[axis];
  const auto length = static_cast<size_t>(lines.values.length_px);
  EdgeCounts counts;
  constexpr size_t kSpan = 2 * kReach_px + 1;
  for (size_t start = 0; start < lines.values.size(); start += length) {
    for (size_t from = start; from + kSpan < start + length; ++from) {
      const size_t to = from + kSpan;  // the edge lies between the two places in the middle
      if (std::any_of(&lines.lit[from], &lines.lit[to] + 1, [](char lit) { return lit == 0; })) continue;
      const float before = value(lines, coarse, from), after = value(lines, coarse, to);
      const float near = value(lines, coarse, from + kReach_px), far = value(lines, coarse, to - kReach_px);
      if (before * after > 0.0f || near * far > 0.0f) continue;
      if (std::min(std::abs(before), std::abs(after)) < kSure) continue;
      (after > before ? counts.rising : counts.falling) += 1;
      const float fine_before = value(lines, fine, from), fine_after = value(lines, fine, to);
      if (std::min(std::abs(fine_before), std::abs(fine_after)) < kSure) continue;
      if (fine_before * fine_after < 0.0f) {
        ++counts.also_edge;
      } else {
        ++(fine_before > 0.0f ? counts.lit : counts.dark);
      }
    }
  }
  return counts;
}

PatternView::Fringe PatternView::fringe(int first, int steps) const {
  Fringe fringe;
  double unexplained = 0.0, modulated = 0.0, count = 0.0, means = 0.0, squares = 0.0;
  for (size_t axis = 0; axis < 2; ++axis) {
    const Lines& lines = lines_[axis];
    std::vector<std::complex<double>> phasors(lines.values.size());
    for (size_t i = 0; i < phasors.size(); ++i) {
      if (lines.lit[i] == 0) continue;
      double mean = 0.0, energy = 0.0;
      for (int k = 0; k < steps; ++k) {
        const double u = static_cast<double>(lines.values.codes[static_cast<size_t>(first + k)][i]);
        mean += u / steps;
        energy += u * u / steps;
        phasors[i] += u * std::polar(2.0 / steps, 2.0 * std::numbers::pi * k / steps);
      }
      energy -= mean * mean;
      modulated += energy;
      unexplained += std::max(0.0, energy - 0.5 * std::norm(phasors[i]));
      count += 1.0;
      means += mean;
      squares += mean * mean;
    }
    std::complex<double> turn;
    const auto length = static_cast<size_t>(lines.values.length_px);
    for (size_t i = 0; i + 1 < phasors.size(); ++i) {
      if ((i + 1) % length != 0) turn += std::conj(phasors[i]) * phasors[i + 1];
    }
    fringe.turn_rad[axis] = std::arg(turn);
  }
  fringe.residual = unexplained / std::max(modulated, 1e-12);
  means /= std::max(count, 1.0);
  fringe.mean_spread = std::sqrt(std::max(0.0, squares / std::max(count, 1.0) - means * means));
  return fringe;
}

}  // namespace glasswing
