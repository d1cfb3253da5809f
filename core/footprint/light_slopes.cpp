#include "core/footprint/light_slopes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kExtent = 3.7;          // standard deviations
constexpr double kMinVariance = 0.36;    // in samples: narrower ones would fall between them
constexpr double kLevelVariance = 0.64;  // in samples, from which a coarser level is sufficient

// Of the filter of a level's samples (pyramid.h), with the flat pixel of level 0.
double blur_px2(double spacing_px) {
  return 5.0 * (spacing_px * spacing_px - 1.0) / 12.0;
}

}  // namespace

LitMonitor::LitMonitor(const RadianceImage& picture, const PrimaryMix& mix, int texture, int thread_count)
    : shape_(picture.width_px, picture.height_px, 0), samples_(shape_.end()) {
  fill_pyramid(picture, mix, texture, shape_, static_cast<int>(shape_.levels().size()), 0, thread_count,
               samples_.data());
}

LightSlopes LitMonitor::slopes(const Footprint& mode, int channel) const {
  const double narrow = axis_variances(covariance_of(mode)).narrow + kFlatPixel_px2;
  size_t l = 0;
  double spacing_px = 1.0;
  while (l + 1 < shape_.levels().size() &&
         narrow - blur_px2(2.0 * spacing_px) >= kLevelVariance * 4.0 * spacing_px * spacing_px)
    ++l, spacing_px *= 2.0;
  const PyramidShape::Level& level = shape_.levels()[l];
  // In samples of that level.
  const double unit = 1.0 / (spacing_px * spacing_px), less = kFlatPixel_px2 - blur_px2(spacing_px);
  const Footprint own = with_positive_covariance({.weight = 1.0,
                                                  .x_px = mode.x_px / spacing_px - 0.5,
                                                  .y_px = mode.y_px / spacing_px - 0.5,
                                                  .xx_px2 = (mode.xx_px2 + less) * unit,
                                                  .xy_px2 = mode.xy_px2 * unit,
                                                  .yy_px2 = (mode.yy_px2 + less) * unit},
                                                 kMinVariance);
  const double determinant = own.xx_px2 * own.yy_px2 - own.xy_px2 * own.xy_px2;
  const double pxx = own.yy_px2 / determinant, pxy = -own.xy_px2 / determinant,
               pyy = own.xx_px2 / determinant;
  const double peak = 1.0 / (2.0 * std::numbers::pi * std::sqrt(determinant));
  struct Range {
    int first = 0, last = -1;
  };
  const auto range = [](double centre, double reach, int size) {
    constexpr int kBorder = PyramidShape::kBorder;
    const double low = std::clamp(centre - reach, -1.0 * kBorder, 1.0 * (size + kBorder)),
                 high = std::clamp(centre + reach, -1.0 - kBorder, size + kBorder - 1.0);
    return Range{.first = static_cast<int>(std::ceil(low)), .last = static_cast<int>(std::floor(high))};
  };
  LightSlopes sum;
  const Range rows = range(own.y_px, kExtent * std::sqrt(own.yy_px2), level.height_px);
  for (int y = rows.first; y <= rows.last; ++y) {
    const double dy = y - own.y_px;
    const Range columns =
        range(own.x_px + own.xy_px2 / own.yy_px2 * dy, kExtent / std::sqrt(pxx), level.width_px);
    const float* const row = samples_.data() + level.at(0, y, channel);
    for (int x = columns.first; x <= columns.last; ++x) {
      const double dx = x - own.x_px, qx = pxx * dx + pxy * dy, qy = pxy * dx + pyy * dy;
      const double light = peak * std::exp(-0.5 * (dx * qx + dy * qy)) * row[x];
      sum.light += light;
      sum.by_x += light * qx;
      sum.by_y += light * qy;
      sum.by_xx += 0.5 * light * (qx * qx - pxx);
      sum.by_xy += light * (qx * qy - pxy);
      sum.by_yy += 0.5 * light * (qy * qy - pyy);
    }
  }
  for (double* slope : {&sum.by_x, &sum.by_y}) *slope /= spacing_px;
  for (double* slope : {&sum.by_xx, &sum.by_xy, &sum.by_yy}) *slope *= unit;
  return sum;
}

}  // namespace glasswing
