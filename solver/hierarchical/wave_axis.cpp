#include "solver/hierarchical/wave_axis.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "solver/hierarchical/wave_kernel.h"

namespace glasswing {
namespace {

constexpr size_t kMaxOpen = 80;  // three open nodes on each of at most 16 levels
constexpr size_t kKept = 3;      // the best grid points that are refined
constexpr float kUnsure = 0.4f;  // u of a wave that may have the other sign

// +1 in lit bars, which are the even ones.
double sign_of(double bar) {
  return static_cast<std::int64_t>(bar) % 2 == 0 ? 1.0 : -1.0;
}

double drawn(const BarWave& wave, int pixel) {
  return sign_of(std::floor((pixel + 0.5 - wave.offset_px) / wave.bar_px));
}

internal::SoftPlace place_of(const WaveAxis::SoftSide& side) {
  const double whole_px = std::floor(side.t_px);
  return {.whole_px = static_cast<float>(whole_px),
          .part_px = static_cast<float>(side.t_px - whole_px),
          .sigma_px = static_cast<float>(side.sigma_px)};
}

std::optional<double> period_of(std::span<const BarWave> waves, double extent_px) {
  constexpr double kSame = 1e-6;  // periods
  double period_px = 0.0;
  for (const BarWave& wave : waves) period_px = std::max(period_px, 2.0 * wave.bar_px);
  if (period_px >= extent_px) return std::nullopt;
  for (const BarWave& wave : waves) {
    const double periods = period_px / (2.0 * wave.bar_px);
    if (std::abs(periods - std::round(periods)) > kSame) return std::nullopt;
  }
  return period_px;
}

}  // namespace

struct WaveAxis::Lanes {
  std::array<float, kMaxWaves> u{}, weight{};

  explicit Lanes(std::span<const Seen> seen) {
    for (size_t k = 0; k < seen.size(); ++k) {
      u[k] = seen[k].u;
      weight[k] = seen[k].weight;
    }
  }
};

WaveAxis::WaveAxis(std::span<const BarWave> waves, int extent_px)
    : waves_(waves.begin(), waves.end()),
      wave_count_(waves.size()),
      stride_((waves.size() + internal::kWaveLanes - 1) / internal::kWaveLanes * internal::kWaveLanes),
      extent_px_(extent_px),
      finest_bar_px_(extent_px),
      period_px_(period_of(waves, extent_px)) {
  assert(!waves.empty() && waves.size() <= kMaxWaves && extent_px > 0);
  bars_px_.resize(stride_, 1.0f);
  offsets_px_.resize(stride_, 0.0f);
  for (size_t k = 0; k < wave_count_; ++k) {
    bars_px_[k] = static_cast<float>(waves[k].bar_px);
    offsets_px_[k] = static_cast<float>(waves[k].offset_px);
    finest_bar_px_ = std::min(finest_bar_px_, waves[k].bar_px);
  }
  per_px_ = finest_bar_px_ < 2.0 ? 4 : 1;
  last_point_ = extent_px * per_px_;
  auto cells = static_cast<size_t>(last_point_) + 1;
  sums_.resize(cells * stride_);
  for (size_t k = 0; k < wave_count_; ++k) {
    for (int point = 0; point < last_point_; ++point) {
      const size_t at = static_cast<size_t>(point) * stride_ + k;
      sums_[at + stride_] = sums_[at] + static_cast<float>(drawn(waves[k], point / per_px_));
    }
  }
  if (wave_count_ <= kMaxDecoded) {
    readings_.resize(size_t{1} << wave_count_);
    for (int pixel = 0; pixel < extent_px; ++pixel) {
      Reading& reading = readings_[signs_at(pixel + 0.5)];
      // Positions that all waves show alike: the first is as good as any.
      if (reading.to_px >= 0.0f && reading.to_px != static_cast<float>(pixel)) continue;
      if (reading.to_px < 0.0f) reading.from_px = static_cast<float>(pixel);
      reading.to_px = static_cast<float>(pixel + 1);
    }
  }
  if (edges_coincide() && !readings_.empty()) {
    std::array<double, kMaxWaves> v;
    for (double low_px = 0.0; low_px + finest_bar_px_ <= extent_px_; low_px += 0.5 * finest_bar_px_) {
      means({.low_px = low_px, .high_px = low_px + finest_bar_px_}, v);
      const size_t at = scanned_.size();
      scanned_.resize(at + stride_);
      for (size_t k = 0; k < wave_count_; ++k) scanned_[at + k] = static_cast<float>(v[k]);
    }
  }
  first_cell_.push_back(0);
  for (size_t point = 0; point < cells; ++point) {
    const auto* own = sums_.data() + point * stride_;
    for (int twice = 0; twice < 2; ++twice) cells_.insert(cells_.end(), own, own + stride_);
  }
  while (cells > 1) {
    const size_t finer = first_cell_.back(), count = cells;
    first_cell_.push_back(finer + count);
    cells = (count + 1) / 2;
    for (size_t cell = 0; cell < cells; ++cell) {
      const size_t a = (finer + 2 * cell) * 2 * stride_;
      const size_t b = 2 * cell + 1 < count ? a + 2 * stride_ : a;
      for (size_t k = 0; k < stride_; ++k) cells_.push_back(std::min(cells_[a + k], cells_[b + k]));
      for (size_t k = stride_; k < 2 * stride_; ++k) cells_.push_back(std::max(cells_[a + k], cells_[b + k]));
    }
  }
}

std::uint32_t WaveAxis::signs_at(double t_px) const {
  std::uint32_t signs = 0;
  for (size_t k = 0; k < wave_count_; ++k) signs |= wave_at(k, t_px) > 0.0 ? 1u << k : 0u;
  return signs;
}

bool WaveAxis::edges_coincide() const {
  for (int point = per_px_; point < last_point_; ++point) {
    const int edges =
        std::popcount(signs_at((point - 0.5) * grid_px()) ^ signs_at((point + 0.5) * grid_px()));
    if (edges > 1) return true;
  }
  return false;
}

std::optional<double> WaveAxis::decode(std::span<const Seen> seen) const {
  if (readings_.empty()) return std::nullopt;
  size_t signs = 0, unsure = 0;
  for (size_t k = 0; k < wave_count_; ++k) {
    signs |= seen[k].u > 0.0f ? size_t{1} << k : 0u;
    if (waves_[k].bar_px > 2.0 * finest_bar_px_ && std::abs(seen[k].u) < kUnsure) ++unsure;
  }
  if (unsure > 0 && !scanned_.empty()) return scan(seen);
  const Reading& reading = readings_[signs];
  if (reading.to_px < reading.from_px) return std::nullopt;
  return 0.5 * static_cast<double>(reading.from_px + reading.to_px);
}

double WaveAxis::scan(std::span<const Seen> seen) const {
  const Lanes lanes(seen);
  std::array<float, kMaxWaves> product;
  for (size_t k = 0; k < stride_; ++k) product[k] = lanes.u[k] * lanes.weight[k];
  float best = 0.0f;
  size_t place = 0;
  for (size_t at = 0; at * stride_ < scanned_.size(); ++at) {
    const float* v = scanned_.data() + at * stride_;
    float both = 0.0f, own = 1e-20f;
    for (size_t k = 0; k < stride_; ++k) {
      both += product[k] * v[k];
      own += lanes.weight[k] * v[k] * v[k];
    }
    if (both <= 0.0f || both * both <= best * own) continue;
    best = both * both / own;
    place = at;
  }
  return 0.5 * finest_bar_px_ * (static_cast<double>(place) + 1.0);
}

std::vector<double> WaveAxis::misreadings(std::span<const Seen> seen, std::span<const double> model,
                                          double t_px, double apart_px, double price) const {
  std::vector<double> places_px;
  if (readings_.empty()) return places_px;
  const std::uint32_t signs = signs_at(t_px);
  for (size_t k = 0; k < wave_count_; ++k) {
    const Reading& other = readings_[signs ^ 1u << k];
    const auto from = static_cast<double>(other.from_px), to = static_cast<double>(other.to_px);
    if (to < from || (t_px > from - apart_px && t_px < to + apart_px)) continue;
    const double own = 4.0 * seen[k].weight * seen[k].u * model[k];
    if (own < price) places_px.push_back(0.5 * (from + to));
  }
  return places_px;
}

std::optional<std::array<double, 2>> WaveAxis::alike_px() const {
  std::map<std::uint32_t, double> last_seen_px;  // last position, by the signs of all waves
  for (double t_px = 0.5; t_px < extent_px_; t_px += 1.0) {
    const auto [last, first_time] = last_seen_px.try_emplace(signs_at(t_px), t_px);
    if (!first_time && t_px - last->second > 1.0) return std::array{last->second, t_px};
    last->second = t_px;
  }
  return std::nullopt;
}

void WaveAxis::means(const Interval& interval, std::span<double> v) const {
  const auto place = [&](double t_px) {
    const double t = t_px * per_px_;
    const int point = std::clamp(static_cast<int>(t), 0, last_point_ - 1);
    return std::pair(sums_.data() + static_cast<size_t>(point) * stride_, t - point);
  };
  const auto [low, low_part] = place(interval.low_px);
  const auto [high, high_part] = place(interval.high_px);
  const double scale = 1.0 / (interval.length_px() * per_px_);
  for (size_t k = 0; k < wave_count_; ++k) {
    const double whole = high[k] - low[k];
    const double at_high = high[k + stride_] - high[k];
    const double at_low = low[k + stride_] - low[k];
    v[k] = (whole + high_part * at_high - low_part * at_low) * scale;
  }
}

WaveAxis::SoftMeans WaveAxis::soft_means(const SoftSide& side) const {
  SoftMeans means;
  internal::soft_means_of({.bar_px = bars_px_.data(), .offset_px = offsets_px_.data()}, place_of(side),
                          stride_, means.v.data(), means.by_t.data(), means.by_sigma.data());
  return means;
}

WaveAxis::SoftSide WaveAxis::refine_soft(std::span<const Seen> seen, const SoftSide& start) const {
  constexpr int kIterations = 8;
  constexpr double kMinSigma_px = 0.05, kEnough = 1e-5, kShort = 0.1;
  const Lanes lanes(seen);
  struct Sums {
    double cost = 0.0, tt = 0.0, ts = 0.0, ss = 0.0, t = 0.0, s = 0.0;
  };
  const auto sums_at = [&](const SoftSide& at) {
    const internal::SoftSums sums =
        internal::soft_sums_of({.bar_px = bars_px_.data(), .offset_px = offsets_px_.data()}, place_of(at),
                               lanes.u.data(), lanes.weight.data(), stride_);
    return Sums{.cost = sums.cost, .tt = sums.tt, .ts = sums.ts, .ss = sums.ss, .t = sums.t, .s = sums.s};
  };
  SoftSide best = start;
  Sums at = sums_at(best);
  double damping = 1e-2;
  for (int i = 0; i < kIterations; ++i) {
    const double tt = at.tt * (1.0 + damping) + 1e-9, ss = at.ss * (1.0 + damping) + 1e-9;
    const double rest = tt * ss - at.ts * at.ts;
    const double reach_px = 0.5 * finest_bar_px_;
    const double dt = std::clamp((ss * at.t - at.ts * at.s) / rest, -reach_px, reach_px);
    const double ds = std::clamp((tt * at.s - at.ts * at.t) / rest, -0.5 * best.sigma_px, reach_px);
    // What the step would gain, were the means linear; a long one may leave a plateau.
    const double step = std::max(std::abs(dt), std::abs(ds)), gain = dt * at.t + ds * at.s;
    if (step < kShort * best.sigma_px && gain < kEnough * at.cost) break;
    const SoftSide next{.t_px = std::clamp(best.t_px + dt, 0.0, extent_px_),
                        .sigma_px = std::clamp(best.sigma_px + ds, kMinSigma_px, extent_px_)};
    const Sums there = sums_at(next);
    if (!(there.cost < at.cost)) {
      damping *= 10.0;
      continue;
    }
    const bool enough = at.cost - there.cost < kEnough * at.cost;
    best = next;
    at = there;
    damping *= 0.1;
    if (enough) break;
  }
  return best;
}

double WaveAxis::wave_at(size_t wave, double t_px) const {
  const int point = std::clamp(static_cast<int>(t_px * per_px_), 0, last_point_ - 1);
  const size_t at = static_cast<size_t>(point) * stride_ + wave;
  return static_cast<double>(sums_[at + stride_] - sums_[at]);
}

double WaveAxis::cost(std::span<const Seen> seen, const Interval& interval) const {
  return cost(Lanes(seen), interval);
}

double WaveAxis::cost(const Lanes& seen, const Interval& interval) const {
  const auto place = [&](double t) { return std::clamp(static_cast<int>(t), 0, last_point_ - 1); };
  const double low = interval.low_px * per_px_, high = interval.high_px * per_px_;
  const int low_point = place(low), high_point = place(high);
  const float miss = internal::cost_of({.low = sums_.data() + static_cast<size_t>(low_point) * stride_,
                                        .high = sums_.data() + static_cast<size_t>(high_point) * stride_,
                                        .low_part = static_cast<float>(low - low_point),
                                        .high_part = static_cast<float>(high - high_point),
                                        .distance = static_cast<float>(high - low)},
                                       seen.u.data(), seen.weight.data(), stride_);
  return miss + interval.length_px() / extent_px_;
}

size_t WaveAxis::split(const Lanes& seen, const Node& node, float enough, std::array<Node, 4>& parts) const {
  const int level = node.level - 1, size = 1 << level, last = last_point_ >> level;
  internal::CellPairs pairs;
  std::array<int, 2> low_cells, high_cells;
  for (size_t i = 0; i < 2; ++i) {
    const int side = static_cast<int>(i);
    low_cells[i] = std::min(2 * node.low + side, last);
    high_cells[i] = std::min(2 * node.high + side, last);
    pairs.low[i] = least(level, low_cells[i]);
    pairs.high[i] = least(level, high_cells[i]);
    pairs.first[i] = sums_.data() + static_cast<size_t>(low_cells[i] * size) * stride_;
    pairs.last[i] =
        sums_.data() + static_cast<size_t>(std::min((high_cells[i] + 1) * size - 1, last_point_)) * stride_;
  }
  for (size_t i = 0; i < 4; ++i) {
    const int low_first = low_cells[i / 2] * size, high_first = high_cells[i % 2] * size;
    const int low_last = std::min(low_first + size - 1, last_point_);
    const int high_last = std::min(high_first + size - 1, last_point_);
    pairs.shortest[i] = static_cast<float>(std::max(high_first - low_last, 1));
    pairs.longest[i] = static_cast<float>(std::max(high_last - low_first, 1));
  }
  const std::array<float, 4> bounds = internal::bounds_of(pairs, seen.u.data(), seen.weight.data(), stride_);
  size_t count = 0;
  for (size_t i = 0; i < 4; ++i) {
    const int low = 2 * node.low + static_cast<int>(i / 2), high = 2 * node.high + static_cast<int>(i % 2);
    if (high > last || low > high || (low == high && level == 0)) continue;
    const Node part{.level = level,
                    .low = low,
                    .high = high,
                    .bound = bounds[i] + pairs.shortest[i] / static_cast<float>(last_point_)};
    if (part.bound >= enough) continue;
    size_t place = count++;
    for (; place > 0 && parts[place - 1].bound < part.bound; --place) parts[place] = parts[place - 1];
    parts[place] = part;
  }
  return count;
}

IntervalFit WaveAxis::on_grid(const Lanes& seen, const Interval& around) const {
  const double low = std::clamp(std::round(around.low_px * per_px_), 0.0, last_point_ - 1.0);
  const double high = std::clamp(std::round(around.high_px * per_px_), low + 1.0, 1.0 * last_point_);
  IntervalFit fit{.interval = {.low_px = low * grid_px(), .high_px = high * grid_px()}};
  fit.cost = cost(seen, fit.interval);
  while (shift(seen, grid_px(), fit)) {
  }
  return fit;
}

IntervalFit WaveAxis::search(std::span<const Seen> seen, const Interval& hint) const {
  const Lanes lanes(seen);
  std::array<Node, kMaxOpen> open;
  size_t open_count = 0;
  open[open_count++] = {.level = static_cast<int>(first_cell_.size()) - 1};
  float enough = std::numeric_limits<float>::infinity();
  std::array<Interval, kKept> kept;
  size_t found = 0;
  if (hint.length_px() > 0.0) {
    const IntervalFit fit = on_grid(lanes, hint);
    kept[found++] = fit.interval;
    enough = static_cast<float>(fit.cost);
  }
  while (open_count > 0) {
    const Node node = open[--open_count];
    if (node.bound >= enough) continue;
    if (node.level == 0) {
      enough = node.bound;
      kept[found++ % kKept] = {.low_px = node.low * grid_px(), .high_px = node.high * grid_px()};
      continue;
    }
    std::array<Node, 4> parts;
    const size_t part_count = split(lanes, node, enough, parts);
    // The best node comes last and is expanded first.
    for (size_t i = 0; i < part_count; ++i) open[open_count++] = parts[i];
  }
  IntervalFit best{.interval = {}, .cost = std::numeric_limits<double>::infinity()};
  for (size_t i = 0; i < std::min(found, kKept); ++i) {
    const IntervalFit fit = refine(lanes, kept[i]);
    if (fit.cost < best.cost) best = fit;
  }
  return best;
}

IntervalFit WaveAxis::refine(std::span<const Seen> seen, const Interval& start) const {
  return refine(Lanes(seen), start);
}

IntervalFit WaveAxis::refine(const Lanes& seen, const Interval& start) const {
  IntervalFit best{.interval = start, .cost = cost(seen, start)};
  for (double step_px = 0.5 * grid_px(); step_px >= kMinLength_px; step_px *= 0.5) {
    while (shift(seen, step_px, best)) {
    }
  }
  best.cost = cost(seen, best.interval);
  return best;
}

bool WaveAxis::shift(const Lanes& seen, double step_px, IntervalFit& best) const {
  std::array<double, 3> low_px, high_px;
  internal::PlaceGrid grid;
  const auto place = [&](double t_px, const float*& point, float& part) {
    const double t = t_px * per_px_;
    const int before = std::clamp(static_cast<int>(t), 0, last_point_ - 1);
    point = sums_.data() + static_cast<size_t>(before) * stride_;
    part = static_cast<float>(t - before);
  };
  for (size_t i = 0; i < 3; ++i) {
    const double shift_px = (static_cast<double>(i) - 1.0) * step_px;
    low_px[i] = best.interval.low_px + shift_px;
    high_px[i] = best.interval.high_px + shift_px;
    place(low_px[i], grid.low[i], grid.low_part[i]);
    place(high_px[i], grid.high[i], grid.high_part[i]);
  }
  for (size_t i = 0; i < 9; ++i)
    grid.distance[i] = static_cast<float>((high_px[i % 3] - low_px[i / 3]) * per_px_);
  const std::array<float, 9> costs = internal::costs_of(grid, seen.u.data(), seen.weight.data(), stride_);
  bool shifted = false;
  for (size_t i = 0; i < 9; ++i) {
    const Interval to{.low_px = low_px[i / 3], .high_px = high_px[i % 3]};
    if (i == 4 || to.low_px < 0.0 || to.high_px > extent_px_ || to.length_px() < kMinLength_px) continue;
    const double own = costs[i] + to.length_px() / extent_px_;
    if (own >= best.cost) continue;
    best = {.interval = to, .cost = own};
    shifted = true;
  }
  return shifted;
}

}  // namespace glasswing
