#include "core/matte/box_table.h"

#include <algorithm>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

// Where a side of a box lies among the pixels: `low` and `high` are the pixels that its ends are in, the
// parts how far into them.
struct Side {
  int low, high;
  double low_part, high_part;
  bool is_on;

  Side(float centre_px, float length_px, int extent_px) {
    const auto extent = static_cast<float>(extent_px);
    const float from = std::clamp(centre_px - 0.5f * length_px, 0.0f, extent),
                to = std::clamp(centre_px + 0.5f * length_px, 0.0f, extent);
    is_on = to > from;
    low = std::min(static_cast<int>(from), extent_px - 1);
    high = std::min(static_cast<int>(to), extent_px - 1);
    low_part = static_cast<double>(from) - low;
    high_part = static_cast<double>(to) - high;
  }
};

}  // namespace

BoxTable::BoxTable(const RadianceImage& picture, int thread_count)
    : width_px_(picture.width_px),
      height_px_(picture.height_px),
      sums_(static_cast<size_t>(width_px_ + 1) * static_cast<size_t>(height_px_ + 1)) {
  const auto row = static_cast<size_t>(width_px_ + 1);
  for_rows(height_px_, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      Sums along{};
      Sums* to = sums_.data() + (static_cast<size_t>(y) + 1) * row + 1;
      const float* from = picture.samples.data() + picture.index(0, y, 0);
      for (int x = 0; x < width_px_; ++x, ++to, from += 3) {
        for (size_t c = 0; c < 3; ++c) along[c] += static_cast<double>(from[c]);
        *to = along;
      }
    }
  });
  // Then down, columns shared.
  for_rows(width_px_, thread_count, [&](int first, int last) {
    for (size_t y = 2; y <= static_cast<size_t>(height_px_); ++y) {
      Sums* const to = sums_.data() + y * row + 1;
      for (int x = first; x < last; ++x) {
        for (size_t c = 0; c < 4; ++c) to[x][c] += to[x - static_cast<int>(row)][c];
      }
    }
  });
}

BoxTable::Light BoxTable::mean(float x_px, float y_px, float width_px, float height_px) const {
  width_px = std::max(width_px, kMinSide_px);
  height_px = std::max(height_px, kMinSide_px);
  const Side x(x_px, width_px, width_px_), y(y_px, height_px, height_px_);
  if (!x.is_on || !y.is_on) return {};
  // Along x, between two columns the table is straight.
  const auto across = [&](int row) {
    const Sums &a = at(x.low, row), &b = at(x.low + 1, row), &c = at(x.high, row), &d = at(x.high + 1, row);
    Sums sum;
    for (size_t i = 0; i < 4; ++i)
      sum[i] = (c[i] + x.high_part * (d[i] - c[i])) - (a[i] + x.low_part * (b[i] - a[i]));
    return sum;
  };
  const Sums a = across(y.low), b = across(y.low + 1), c = across(y.high), d = across(y.high + 1);
  const double share = 1.0 / (static_cast<double>(width_px) * static_cast<double>(height_px));
  Light light;
  for (size_t i = 0; i < 3; ++i) {
    const double sum = (c[i] + y.high_part * (d[i] - c[i])) - (a[i] + y.low_part * (b[i] - a[i]));
    light[i] = static_cast<float>(share * sum);
  }
  return light;
}

}  // namespace glasswing
