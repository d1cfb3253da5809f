#include "core/composite/summed_area_table.h"

#include <algorithm>
#include <cmath>

#include "core/base/for_rows.h"
#include "core/composite/box_side.h"

namespace glasswing {
namespace {

// Differences of sums lose digits for small boxes, so these are added up pixel by pixel.
constexpr int kFewPixels = 64;

// One side of a box of FastSummedAreaTable: its ends lie in the pixels `low` and `high`, at the fractions
// `low_part` and `high_part` of them.
struct FloatSide {
  int low, high;
  double low_part, high_part;
  bool is_on;

  FloatSide(float centre_px, float length_px, int extent_px) {
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

SummedAreaTable::SummedAreaTable(const RadianceImage& picture) : picture_(picture) {
  const auto row = (static_cast<size_t>(picture.width_px) + 1) * kChannels;
  sums_.resize(row * (static_cast<size_t>(picture.height_px) + 1));
  for (int y = 0; y < picture.height_px; ++y) {
    double along[kChannels] = {};
    size_t at = (static_cast<size_t>(y) + 1) * row + kChannels;
    for (int x = 0; x < picture.width_px; ++x) {
      for (int c = 0; c < kChannels; ++c, ++at) {
        along[c] += static_cast<double>(picture.at(x, y, c));
        sums_[at] = sums_[at - row] + along[c];
      }
    }
  }
}

double SummedAreaTable::mean(const Mode& box, int channel) const {
  if (picture_.empty()) return 0.0;
  const BoxSide x(static_cast<double>(box.x_px), static_cast<double>(box.xx_px2), picture_.width_px);
  const BoxSide y(static_cast<double>(box.y_px), static_cast<double>(box.yy_px2), picture_.height_px);
  if (x.last <= x.first || y.last <= y.first) return 0.0;
  if (x.length_px == 0.0 || y.length_px == 0.0 || (x.last - x.first) * (y.last - y.first) <= kFewPixels)
    return mean_of_pixels(x, y, channel);
  const double inside = sum(x.high_px, y.high_px, channel) - sum(x.low_px, y.high_px, channel) -
                        sum(x.high_px, y.low_px, channel) + sum(x.low_px, y.low_px, channel);
  return inside / (x.length_px * y.length_px);
}

double SummedAreaTable::mean_of_pixels(const BoxSide& x, const BoxSide& y, int channel) const {
  double all = 0.0;
  for (int v = y.first; v < y.last; ++v) {
    double row = 0.0;
    for (int u = x.first; u < x.last; ++u) row += x.share(u) * picture_.at(u, v, channel);
    all += y.share(v) * row;
  }
  return all;
}

double SummedAreaTable::sum(double x_px, double y_px, int channel) const {
  const int u = std::min(static_cast<int>(x_px), picture_.width_px - 1);
  const int v = std::min(static_cast<int>(y_px), picture_.height_px - 1);
  const double right = x_px - u, down = y_px - v;
  const auto row = (static_cast<size_t>(picture_.width_px) + 1) * kChannels;
  const double* at =
      sums_.data() + static_cast<size_t>(v) * row + u * kChannels + static_cast<size_t>(channel);
  const double above = at[0] + right * (at[kChannels] - at[0]);
  const double below = at[row] + right * (at[row + kChannels] - at[row]);
  return above + down * (below - above);
}

FastSummedAreaTable::FastSummedAreaTable(const RadianceImage& picture, int thread_count)
    : width_px_(picture.width_px),
      height_px_(picture.height_px),
      sums_(static_cast<size_t>(width_px_ + 1) * (height_px_ + 1)) {
  const size_t row = width_px_ + 1;
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
  // Then down the columns, which the threads share.
  for_rows(width_px_, thread_count, [&](int first, int last) {
    for (size_t y = 2; y <= static_cast<size_t>(height_px_); ++y) {
      Sums* const to = sums_.data() + y * row + 1;
      for (int x = first; x < last; ++x) {
        for (size_t c = 0; c < 4; ++c) to[x][c] += to[x - static_cast<int>(row)][c];
      }
    }
  });
}

FastSummedAreaTable::Light FastSummedAreaTable::mean(float x_px, float y_px, float width_px,
                                                     float height_px) const {
  width_px = std::max(width_px, kMinSide_px);
  height_px = std::max(height_px, kMinSide_px);
  const FloatSide x(x_px, width_px, width_px_), y(y_px, height_px, height_px_);
  if (!x.is_on || !y.is_on) return {};
  // The table is linear in x between two columns.
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
