#include "core/footprint/lit_area.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kReach = 5.5;  // standard deviations
constexpr double kFine = 1.4;   // sigmas per bar, from which bars are seen as their mean
constexpr double kMinVariance_px2 = 1e-4;

double variance_across(const Footprint& mode, const LitArea& area) {
  return std::max(area.horizontal ? mode.yy_px2 : mode.xx_px2, kMinVariance_px2);
}

// Bars are seen as their mean.
bool is_fine(const Footprint& mode, const LitArea& area) {
  return std::sqrt(variance_across(mode, area)) > kFine * area.bar_px;
}

NormalDensity density_of(const Footprint& mode) {
  const Footprint own = with_positive_covariance(mode, kMinVariance_px2);
  return {.x = own.x_px, .y = own.y_px, .xx = own.xx_px2, .xy = own.xy_px2, .yy = own.yy_px2};
}

// No edge of the monitor cuts the footprint.
NormalShare share_of_bars(const Footprint& mode, const LitArea& area) {
  const double centre = area.horizontal ? mode.y_px : mode.x_px, variance = variance_across(mode, area);
  const double sigma = std::sqrt(variance);
  NormalShare sum{};
  if (is_fine(mode, area)) {
    sum.share = 0.5;
    return sum;
  }
  auto bar = static_cast<std::int64_t>(std::floor((centre - kReach * sigma - area.offset_px) / area.bar_px));
  sum.share = is_lit(area, bar) ? 1.0 : 0.0;
  double by_centre = 0.0, by_variance = 0.0;
  const auto edge_px = [&] { return area.offset_px + static_cast<double>(bar) * area.bar_px; };
  for (++bar; edge_px() < centre + kReach * sigma; ++bar) {
    const double z = (edge_px() - centre) / sigma;
    const double sign = is_lit(area, bar) ? 1.0 : -1.0, density = sign * normal_density(z);
    sum.share += sign * normal_integral(-z);
    by_centre += density / sigma;
    by_variance += 0.5 * density * z / variance;
  }
  (area.horizontal ? sum.by_y : sum.by_x) = by_centre;
  (area.horizontal ? sum.by_yy : sum.by_xx) = by_variance;
  return sum;
}

}  // namespace

bool is_lit(const LitArea& area, std::int64_t bar) {
  return (bar % 2 == 0) != area.inverse;
}

bool same_bars(const LitArea& a, const LitArea& b) {
  return a.bars && b.bars && a.horizontal == b.horizontal && a.bar_px == b.bar_px &&
         a.offset_px == b.offset_px;
}

LitShare::LitShare(const Footprint& mode, const MonitorExtent& extent)
    : mode_(mode),
      extent_(extent),
      whole_{.share = 1.0, .by_x = 0.0, .by_y = 0.0, .by_xx = 0.0, .by_xy = 0.0, .by_yy = 0.0} {
  if (!near_edge(mode, extent)) return;
  cut_.emplace(density_of(mode));
  whole_ = cut_->share({.left = 0.0, .top = 0.0, .right = extent.width_px, .bottom = extent.height_px});
}

NormalShare LitShare::of(const LitArea& area) {
  if (!area.bars) return whole_;
  if (!same_bars(before_, area)) {
    before_ = area;
    of_before_ = of_bars(area);
  } else if (before_.inverse != area.inverse) {
    before_ = area;
    of_before_ = sum_of(whole_, -1.0, of_before_);
  }
  return of_before_;
}

NormalShare LitShare::of_bars(const LitArea& area) const {
  if (!cut_) return share_of_bars(mode_, area);
  if (is_fine(mode_, area)) return sum_of({}, 0.5, whole_);
  const double centre = area.horizontal ? mode_.y_px : mode_.x_px,
               reach = kReach * std::sqrt(variance_across(mode_, area)),
               side = area.horizontal ? extent_.height_px : extent_.width_px;
  const double from = std::max(0.0, centre - reach), to = std::min(side, centre + reach);
  NormalShare sum{};
  auto bar = static_cast<std::int64_t>(std::floor((from - area.offset_px) / area.bar_px));
  const auto edge_px = [&](std::int64_t b) { return area.offset_px + static_cast<double>(b) * area.bar_px; };
  for (; edge_px(bar) < to; ++bar) {
    if (!is_lit(area, bar)) continue;
    const double low = std::max(0.0, edge_px(bar)), high = std::min(side, edge_px(bar + 1));
    Rectangle lit{.left = 0.0, .top = 0.0, .right = extent_.width_px, .bottom = extent_.height_px};
    (area.horizontal ? lit.top : lit.left) = low;
    (area.horizontal ? lit.bottom : lit.right) = high;
    sum = sum_of(sum, 1.0, cut_->share(lit));
  }
  return sum;
}

double lit_share_error(const Footprint& mode, const LitArea& area, const MonitorExtent& extent) {
  if (!area.bars) return 0.0;
  const double sigma = std::sqrt(variance_across(mode, area));
  // Light of half a bar more or less, with at most the density of the footprint's centre.
  if (is_fine(mode, area))
    return near_edge(mode, extent) ? 0.25 * area.bar_px * normal_density(0.0) / sigma : 0.0;
  // The first harmonic of the bars.
  const double angle = kPi / (2.0 * area.bar_px) * sigma, box = std::sqrt(12.0) * angle;
  const double contrast_of_box = box > 1e-3 ? std::sin(box) / box : 1.0;
  return 2.0 / kPi * std::abs(std::exp(-2.0 * angle * angle) - contrast_of_box);
}

}  // namespace glasswing
