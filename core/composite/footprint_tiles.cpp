#include "core/composite/footprint_tiles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/composite/footprint_quadrature.h"
#include "core/matte/covariance_axes.h"

namespace glasswing {
namespace {

// Samples of a Gaussian of variance v sum to 1 within 2 exp(-2 pi^2 v) and have the right centroid within
// 4 pi v exp(-2 pi^2 v): 0.0008 and 0.002 samples at 0.4.
constexpr double kMinVariance = 0.4;
// Sigmas; the 0.5 % of a Gaussian that lies beyond along an axis is added to the end samples. Modes of weight
// above 1 reach further, so that the light beyond stays as small: the centre of a bright mode may lie beyond
// the monitor, which then sees only its tail.
constexpr double kTileReach = 2.8;
// For thin footprints nothing is added to the ends; 0.1 % is omitted.
constexpr double kThinReach = 3.3;
// If a footprint slides along u by more than this many of its sigmas along u in a row of v, its light crosses
// a pixel border within a fraction of the row, and a few lines replace it.
constexpr double kLineSlope = 8.0;
// Gauss-Hermite, for a normal variable.
constexpr std::array<double, 5> kHermiteNodes{-2.8569700138728056, -1.355626179974266, 0.0, 1.355626179974266,
                                              2.8569700138728056};
constexpr std::array<double, 5> kHermiteWeights{0.011257411327720691, 0.22207592200561266, 0.5333333333333333,
                                                0.22207592200561266, 0.011257411327720691};
// Neglecting a correlation changes the footprint by half of it, relative rms.
constexpr double kUpright = 0.02;

// The share of a Gaussian beyond `reach` sigmas on one side: erfc(reach / sqrt 2) / 2, interpolated within
// 2e-6, which half floats do not resolve.
double beyond(double reach) {
  constexpr int kEntries = 1024;
  constexpr double kPerSigma = 128.0;
  static const std::array<double, kEntries + 1> table = [] {
    std::array<double, kEntries + 1> made{};
    for (int i = 0; i < kEntries; ++i) made[i] = 0.5 * std::erfc(i / kPerSigma / std::numbers::sqrt2);
    return made;
  }();
  const double at = reach * kPerSigma;
  if (!(at < kEntries - 1)) return 0.0;
  const auto i = static_cast<size_t>(at);
  return table[i] + (at - static_cast<double>(i)) * (table[i + 1] - table[i]);
}

double side_of(float variance_px2) {
  return std::sqrt(12.0 * std::max<double>(variance_px2, 0.0));
}

// The number of samples or pixels touched by [centre - reach, centre + reach].
double length_of(double variance) {
  return 2.0 * kTileReach * std::sqrt(variance) + 1.0;
}

// The share of a box's side on each pixel that it touches; a side of length 0 touches one.
void overlap(double centre, double side, int extent, int& first, std::vector<float>& weights) {
  weights.clear();
  const double low = centre - 0.5 * side, high = centre + 0.5 * side;
  const double from = std::max(std::floor(low), 0.0);
  const double to =
      std::min(side > 0.0 ? std::ceil(high) : std::floor(low) + 1.0, static_cast<double>(extent));
  if (!(from < to)) return;
  first = static_cast<int>(from);
  for (double pixel = from; pixel < to; pixel += 1.0) {
    const double part = std::min(high, pixel + 1.0) - std::max(low, pixel);
    weights.push_back(side > 0.0 ? static_cast<float>(part / side) : 1.0f);
  }
}

}  // namespace

FootprintTiles::Placement FootprintTiles::place(const Mode& mode) const {
  const double xx = std::max<double>(mode.xx_px2, 0.0), yy = std::max<double>(mode.yy_px2, 0.0),
               xy = mode.xy_px2;
  const auto on = [&](int level) {
    const double scale = std::ldexp(1.0, -level);
    return Placement{.level = level,
                     .x = mode.x_px * scale,
                     .y = mode.y_px * scale,
                     .xx = (xx + 0.5) * scale * scale - 5.0 / 12.0,
                     .xy = xy * scale * scale,
                     .yy = (yy + 0.5) * scale * scale - 5.0 / 12.0,
                     .weight = mode.weight};
  };
  // The minimum variance of a cut along x or y.
  const auto narrowest = [](const Placement& p) {
    return (p.xx * p.yy - p.xy * p.xy) / std::max(p.xx, p.yy);
  };
  const int last = static_cast<int>(shape_.levels().size()) - 1;
  Placement placed = on(0);
  while (placed.level < last) {
    const Placement next = on(placed.level + 1);
    if (next.xx <= 0.0 || next.yy <= 0.0 || narrowest(next) < kMinVariance) break;
    placed = next;
  }
  const auto tiles = [&](const Placement& p) {
    const PyramidShape::Level& level = shape_.levels()[p.level];
    const double rows = std::min<double>(length_of(p.yy), level.height_px);
    const double columns = std::min<double>(length_of(p.xx), level.width_px);
    if (p.xy * p.xy <= kUpright * kUpright * p.xx * p.yy)
      return std::ceil(columns / kTileWidth) * std::ceil(rows / kMaxTileRows);
    const double cut = std::max(p.xx - p.xy * p.xy / p.yy, 0.0), slide = std::abs(p.xy) / p.yy;
    return rows * std::ceil(std::min(columns, length_of(cut) + slide) / kTileWidth);
  };
  while (placed.level < last && tiles(placed) > max_tiles_) {
    placed = on(placed.level + 1);
    const Covariance wide =
        with_min_variance({.xx = placed.xx, .xy = placed.xy, .yy = placed.yy}, kMinVariance);
    placed.xx = wide.xx;
    placed.xy = wide.xy;
    placed.yy = wide.yy;
  }
  return placed;
}

// A Gaussian's values at `first`, `first` + 1, ... from its centre, each from the previous one by two
// products: g(a + 1) = g(a) q(a) and q(a + 1) = q(a) exp(-1 / variance), with q(a) = exp(-(2 a + 1) / (2
// variance)).
class FootprintTiles::Gaussian {
 public:
  explicit Gaussian(double variance)
      : sigma_(std::sqrt(variance)),
        scale_(-0.5 / variance),
        change_(std::exp(2.0 * scale_)),
        peak_(1.0 / (sigma_ * std::sqrt(2.0 * std::numbers::pi))) {}
  double sigma() const { return sigma_; }
  double scale() const { return scale_; }
  double peak() const { return peak_; }
  void start(double first) {
    value_ = peak_ * std::exp(scale_ * first * first);
    ratio_ = std::exp(scale_ * (2.0 * first + 1.0));
  }
  double next() {
    const double value = value_;
    value_ *= ratio_;
    ratio_ *= change_;
    return value;
  }

 private:
  double sigma_, scale_, change_, peak_, value_ = 0.0, ratio_ = 0.0;
};

// Samples a Gaussian at -kBorder to `extent` + kBorder - 1. The light beyond the reach is added to the end
// samples, so that the weights sum to 1 and keep the centroid.
void FootprintTiles::sample(double centre, Gaussian gaussian, double reach, int extent, Taps& taps) const {
  taps.weights.clear();
  const double sigma = gaussian.sigma();
  double low = std::floor(centre - reach * sigma), high = std::floor(centre + reach * sigma);
  // Drops a single sample that would need its own tile.
  if (static_cast<int>(high - low) == kTileWidth)
    (centre - low > high + 1.0 - centre ? low += 1.0 : high -= 1.0);
  const double from = std::max<double>(low, -PyramidShape::kBorder);
  const double to = std::min(high, extent + PyramidShape::kBorder - 1.0);
  if (!(from <= to)) return;
  taps.first = static_cast<int>(from);
  double before = beyond(reach), after = before;
  constexpr double kManySamples = 32.0;
  const bool few = high > low && high - low <= kManySamples;
  // All samples of the reach are needed for their sum, those on the picture for the tile.
  const double first = few ? low : from, last = few ? high : to;
  taps.weights.resize(static_cast<size_t>(last - first) + 1);
  double sum = 0.0, moment = 0.0, away = first + 0.5 - centre;  // moment: about the centre
  gaussian.start(away);
  for (float& weight : taps.weights) {
    const double value = gaussian.next();
    weight = static_cast<float>(value);
    sum += value;
    moment += value * away;
    away += 1.0;
  }
  if (few) {
    after = ((sum - 1.0) * (low + 0.5 - centre) - moment) / (high - low);
    before = 1.0 - sum - after;
    if (from > low)
      taps.weights.erase(taps.weights.begin(),
                         taps.weights.begin() + static_cast<std::ptrdiff_t>(from - low));
    taps.weights.resize(static_cast<size_t>(to - from) + 1);
  }
  if (from == low) taps.weights.front() += static_cast<float>(before);
  if (to == high) taps.weights.back() += static_cast<float>(after);
}

// Integrates a Gaussian over pixels 0 to `extent` - 1. The light beyond the reach is added to the end pixels.
void FootprintTiles::integrate(double centre, double variance, int extent, Taps& taps) const {
  taps.weights.clear();
  const double sigma = std::sqrt(variance);
  const double reach = sigma < kPointSigma_px ? 0.0 : reach_ * sigma;
  const double low = std::floor(centre - reach), high = std::floor(centre + reach);
  const double from = std::max(low, 0.0), to = std::min(high, extent - 1.0);
  if (!(from <= to)) return;
  taps.first = static_cast<int>(from);
  const auto below = [&](double edge) {  // the share of the Gaussian below an edge
    if (edge <= low) return 0.0;
    if (edge > high) return 1.0;
    return 0.5 + 0.5 * std::erf((edge - centre) / (sigma * std::numbers::sqrt2));
  };
  double before = below(from);
  for (double at = from; at <= to; at += 1.0) {
    const double after = below(at + 1.0);
    taps.weights.push_back(static_cast<float>(after - before));
    before = after;
  }
}

int FootprintTiles::add(const Mode& mode, int channel, std::vector<std::uint16_t>& words) {
  words_ = &words;
  count_ = 0;
  const double brighter = 2.0 * std::log(std::max(mode.weight, 1.0f));
  reach_ = std::sqrt(kTileReach * kTileReach + brighter);
  thin_reach_ = std::sqrt(kThinReach * kThinReach + brighter);
  const Placement placed = place(mode);
  const PyramidShape::Level& level = shape_.levels()[placed.level];
  const bool upright = placed.xy * placed.xy <= kUpright * kUpright * placed.xx * placed.yy;
  const double weight = mode.weight;
  if (upright) {
    const auto along = [&](double centre, double left, double variance, int extent, Taps& taps) {
      if (left < kMinVariance) {
        integrate(centre, std::max(variance, 0.0), extent, taps);
      } else {
        sample(centre, Gaussian(left), reach_, extent, taps);
      }
    };
    along(placed.x, placed.xx, static_cast<double>(mode.xx_px2), level.width_px, across_);
    along(placed.y, placed.yy, static_cast<double>(mode.yy_px2), level.height_px, down_);
    add_product(level, weight, channel);
  } else if (placed.level == 0 &&
             (placed.xx * placed.yy - placed.xy * placed.xy) / std::max(placed.xx, placed.yy) <
                 kMinVariance) {
    add_thin(mode, channel);
  } else {
    add_oriented(placed, weight, channel);
  }
  if (count_ > 0) highest_level_ = std::max(highest_level_, placed.level);
  return count_;
}

int FootprintTiles::add_box(const Mode& mode, int channel, std::vector<std::uint16_t>& words) {
  words_ = &words;
  count_ = 0;
  const PyramidShape::Level& picture = shape_.levels().front();
  overlap(mode.x_px, side_of(mode.xx_px2), picture.width_px, across_.first, across_.weights);
  overlap(mode.y_px, side_of(mode.yy_px2), picture.height_px, down_.first, down_.weights);
  add_product(picture, static_cast<double>(mode.weight), channel);
  return count_;
}

int FootprintTiles::add_pyramid(const PyramidFootprint& pyramid, int channel,
                                std::vector<std::uint16_t>& words) {
  constexpr int kBorder = PyramidShape::kBorder;
  const std::vector<PyramidShape::Level>& meshes = shape_.meshes();
  int count = 0;
  points_.clear();
  for (const Coefficient& light : pyramid.coefficients) {
    if (light.level >= kPyramidLevels || !(light.weight > 0.0f)) continue;
    const auto l = static_cast<size_t>(light.level);
    if (l >= meshes.size() || std::min(light.column, light.row) < -kBorder ||
        light.column >= meshes[l].width_px + kBorder || light.row >= meshes[l].height_px + kBorder) {
      count += add(mode_of(light, pyramid.texture), channel, words);
      continue;
    }
    points_.push_back({.sample = static_cast<std::uint32_t>(meshes[l].at(light.column, light.row, channel)),
                       .weight = light.weight});
    highest_mesh_ = std::max(highest_mesh_, light.level);
  }
  highest_level_ = std::max(highest_level_, highest_mesh_);
  return count + add_points(points_, words);
}

bool FootprintTiles::is_small_box(const Mode& mode) {
  const double columns = side_of(mode.xx_px2) + 1.0, rows = side_of(mode.yy_px2) + 1.0;
  return std::ceil(columns / kTileWidth) * rows <= kMaxTileRows;
}

void FootprintTiles::add_product(const PyramidShape::Level& level, double weight, int channel) {
  if (across_.empty() || down_.empty()) return;
  for (float& each : down_.weights) each *= static_cast<float>(weight);
  const std::span<const float> across(across_.weights), down(down_.weights);
  for (size_t x = 0; x < across.size(); x += kTileWidth) {
    const auto columns = across.subspan(x, std::min<size_t>(kTileWidth, across.size() - x));
    for (size_t y = 0; y < down.size(); y += kMaxTileRows) {
      const size_t offset =
          level.at(across_.first + static_cast<int>(x), down_.first + static_cast<int>(y), channel);
      add_tile(static_cast<std::uint32_t>(offset), level.stride, columns,
               down.subspan(y, std::min<size_t>(kMaxTileRows, down.size() - y)), *words_);
      ++count_;
    }
  }
}

void FootprintTiles::add_row(const PyramidShape::Level& level, int x, int y, std::span<const float> across,
                             double weight, int channel) {
  const auto down = static_cast<float>(weight);
  for (size_t u = 0; u < across.size(); u += kTileWidth) {
    add_tile(static_cast<std::uint32_t>(level.at(x + static_cast<int>(u), y, channel)), level.stride,
             across.subspan(u, std::min<size_t>(kTileWidth, across.size() - u)), {&down, 1}, *words_);
    ++count_;
  }
}

void FootprintTiles::add_oriented(const Placement& placed, double weight, int channel) {
  const PyramidShape::Level& level = shape_.levels()[placed.level];
  const double slope = placed.xy / placed.yy, cut = placed.xx - slope * placed.xy;
  sample(placed.y, Gaussian(placed.yy), reach_, level.height_px, down_);
  const Gaussian across(cut);
  const double column = std::floor(placed.x);  // cuts count from it, for their digits
  const SlantedGaussian slanted{.centre = static_cast<float>(placed.x - column),
                                .slope = static_cast<float>(slope),
                                .sigma = static_cast<float>(across.sigma()),
                                .peak = static_cast<float>(across.peak()),
                                .scale = static_cast<float>(across.scale()),
                                .per_variance = static_cast<float>(1.0 / placed.yy),
                                .reach2 = static_cast<float>(reach_ * reach_)};
  const size_t rows = down_.weights.size();
  std::array<float, kTileWidth> weights{};
  for (size_t i = 0; i < rows; i += kTileWidth) {
    const size_t count = std::min<size_t>(kTileWidth, rows - i);
    weights.fill(0.0f);
    for (size_t r = 0; r < count; ++r) weights[r] = static_cast<float>(weight) * down_.weights[i + r];
    const double first = down_.first + static_cast<double>(i) + 0.5 - placed.y;
    cut_rows(slanted, static_cast<float>(first), weights.data(), cuts_);
    for (size_t r = 0; r < count; ++r) {
      const int y = down_.first + static_cast<int>(i + r);
      const int x = static_cast<int>(column) + static_cast<int>(cuts_.first[r]);
      const int samples = static_cast<int>(cuts_.count[r]);
      if (samples > 0 && x >= -PyramidShape::kBorder &&
          x + samples <= level.width_px + PyramidShape::kBorder) {
        add_row_tile(static_cast<std::uint32_t>(level.at(x, y, channel)), level.stride,
                     cuts_.halves[r].data(), *words_);
        ++count_;
        continue;
      }
      const double away = first + static_cast<double>(r);
      const double reach = std::sqrt(std::max(reach_ * reach_ - away * away / placed.yy, 1.0));
      sample(placed.x + slope * away, across, reach, level.width_px, across_);
      if (!across_.empty())
        add_row(level, across_.first, y, across_.weights, weight * down_.weights[i + r], channel);
    }
  }
}

// Adds a tap's weight to the others in its row of v, which begin at `begin`.
void FootprintTiles::add_tap(size_t begin, int u, int v, double weight) {
  const auto same = std::find_if(thin_.begin() + begin, thin_.end(),
                                 [&](const Tap& tap) { return tap.x == u && tap.y == v; });
  if (same == thin_.end()) {
    thin_.push_back({u, v, weight});
  } else {
    same->weight += weight;
  }
}

// As in the exact compositor: in closed form along u, by Gauss-Legendre panels along v.
void FootprintTiles::add_panels(const Thin& thin) {
  const double slide = std::abs(thin.slope) / std::max(std::sqrt(thin.cut), 0.02);
  const double finest = std::max({1.0, 2.0 / thin.sigma, std::min(slide, 50.0)});
  const double whole = std::erf(thin_reach_ / std::numbers::sqrt2);
  const double reach = thin_reach_ * thin.sigma;
  const double first = std::max(std::floor(thin.v - reach), 0.0);
  const double last = std::min(std::ceil(thin.v + reach), static_cast<double>(thin.v_extent));
  for (double v = first; v < last; v += 1.0) {
    const double low = std::max(v, thin.v - reach), high = std::min(v + 1.0, thin.v + reach);
    const int panels = std::max(1, static_cast<int>(std::ceil((high - low) * finest)));
    const double half = 0.5 * (high - low) / panels;
    const size_t begin = thin_.size();
    for (int p = 0; p < panels; ++p) {
      for (size_t n = 0; n < kNodes.size(); ++n) {
        const double away = low + (2 * p + 1 + kNodes[n]) * half - thin.v;
        const double density = std::exp(-0.5 * away * away / (thin.sigma * thin.sigma)) /
                               (thin.sigma * std::sqrt(2.0 * std::numbers::pi) * whole);
        integrate(thin.u + thin.slope * away, thin.cut, thin.u_extent, across_);
        for (size_t i = 0; i < across_.weights.size(); ++i)
          add_tap(begin, across_.first + static_cast<int>(i), static_cast<int>(v),
                  kNodeWeights[n] * half * density * across_.weights[i]);
      }
    }
  }
}

// The narrow Gaussian along u as Gauss-Hermite nodes, each a line u = u_n + slope (v - v_0). In a row of v it
// crosses at most one pixel border: each side has the Gaussian's integral along v up to there.
void FootprintTiles::add_lines(const Thin& thin) {
  const double whole = std::erf(thin_reach_ / std::numbers::sqrt2), reach = thin_reach_ * thin.sigma;
  const auto below = [&](double v) {  // the share of the Gaussian along v
    return 0.5 * std::erf((v - thin.v) / (thin.sigma * std::numbers::sqrt2)) / whole;
  };
  const double narrow = std::sqrt(thin.cut);
  const size_t nodes = narrow < kPointSigma_px ? 1 : kHermiteNodes.size();
  const double first = std::max(std::floor(thin.v - reach), 0.0);
  const double last = std::min(std::ceil(thin.v + reach), static_cast<double>(thin.v_extent));
  double low = std::max(first, thin.v - reach), below_low = below(low);
  for (double v = first; v < last; v += 1.0) {
    const double high = std::min(v + 1.0, thin.v + reach), below_high = below(high);
    const size_t begin = thin_.size();
    for (size_t n = 0; n < nodes; ++n) {
      const double share = nodes == 1 ? 1.0 : kHermiteWeights[n];
      const double u0 = nodes == 1 ? thin.u : thin.u + narrow * kHermiteNodes[n];
      const double from = std::floor(u0 + thin.slope * (low - thin.v));
      const double to = std::floor(u0 + thin.slope * (high - thin.v));
      const auto add = [&](double u, double part) {
        if (u >= 0.0 && u < thin.u_extent)
          add_tap(begin, static_cast<int>(u), static_cast<int>(v), share * part);
      };
      if (from == to) {
        add(from, below_high - below_low);
        continue;
      }
      const double border = below(std::clamp(thin.v + (std::max(from, to) - u0) / thin.slope, low, high));
      add(from, border - below_low);
      add(to, below_high - border);
    }
    low = high;
    below_low = below_high;
  }
}

// Along the narrower axis u in closed form, or as lines, v the other axis. Slopes are at most 1.
void FootprintTiles::add_thin(const Mode& mode, int channel) {
  const PyramidShape::Level& picture = shape_.levels().front();
  const bool exchanged = mode.xx_px2 > mode.yy_px2;
  const double vv = exchanged ? mode.xx_px2 : mode.yy_px2, uv = mode.xy_px2;
  const double uu = std::max<double>(exchanged ? mode.yy_px2 : mode.xx_px2, 0.0);
  const double slope = uv / vv;
  const Thin thin{.u = exchanged ? mode.y_px : mode.x_px,
                  .v = exchanged ? mode.x_px : mode.y_px,
                  .sigma = std::sqrt(vv),
                  .slope = slope,
                  .cut = std::max(uu - slope * uv, 0.0),
                  .u_extent = exchanged ? picture.height_px : picture.width_px,
                  .v_extent = exchanged ? picture.width_px : picture.height_px};
  thin_.clear();
  if (std::abs(slope) > kLineSlope * std::sqrt(thin.cut)) {
    add_lines(thin);
  } else {
    add_panels(thin);
  }
  if (exchanged) {
    for (Tap& tap : thin_) std::swap(tap.x, tap.y);
  }
  std::ranges::sort(thin_, [](const Tap& a, const Tap& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  for (size_t i = 0; i < thin_.size();) {
    const Tap& start = thin_[i];
    std::array<float, kTileWidth> across{};
    size_t count = 0;
    for (; i < thin_.size() && thin_[i].y == start.y && thin_[i].x < start.x + kTileWidth; ++i) {
      count = static_cast<size_t>(thin_[i].x - start.x) + 1;
      across[count - 1] = static_cast<float>(thin_[i].weight);
    }
    add_row(picture, start.x, start.y, {across.data(), count}, static_cast<double>(mode.weight), channel);
  }
}

}  // namespace glasswing
