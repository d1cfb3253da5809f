#include "core/matte/summed_area_table.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kPoint_px = 1e-4;
// Differences of sums lose digits where boxes are small; those are added up pixel by pixel.
constexpr int kFewPixels = 64;

}  // namespace

// One side of a box, and the pixels that it touches.
struct SummedAreaTable::Side {
  double low_px, high_px;  // on the picture
  double length_px;        // of the whole side; 0: a line
  int first, last;         // pixels [first, last)

  Side(double centre_px, double variance_px2, int extent_px) {
    length_px = std::sqrt(12.0 * std::max(variance_px2, 0.0));
    if (length_px < kPoint_px) length_px = 0.0;
    const double extent = extent_px;
    low_px = std::clamp(centre_px - 0.5 * length_px, 0.0, extent);
    high_px = std::clamp(centre_px + 0.5 * length_px, 0.0, extent);
    first = static_cast<int>(std::floor(low_px));
    last = static_cast<int>(std::ceil(high_px));
    if (length_px > 0.0) return;
    const bool on = centre_px >= 0.0 && centre_px < extent;
    last = on ? first + 1 : first;
  }
  // Of the side, the part on a pixel.
  double share(int pixel) const {
    if (length_px == 0.0) return 1.0;
    return (std::min(high_px, pixel + 1.0) - std::max<double>(low_px, pixel)) / length_px;
  }
};

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
  const Side x(static_cast<double>(box.x_px), static_cast<double>(box.xx_px2), picture_.width_px);
  const Side y(static_cast<double>(box.y_px), static_cast<double>(box.yy_px2), picture_.height_px);
  if (x.last <= x.first || y.last <= y.first) return 0.0;
  if (x.length_px == 0.0 || y.length_px == 0.0 || (x.last - x.first) * (y.last - y.first) <= kFewPixels)
    return few(x, y, channel);
  const double inside = sum(x.high_px, y.high_px, channel) - sum(x.low_px, y.high_px, channel) -
                        sum(x.high_px, y.low_px, channel) + sum(x.low_px, y.low_px, channel);
  return inside / (x.length_px * y.length_px);
}

double SummedAreaTable::few(const Side& x, const Side& y, int channel) const {
  double all = 0.0;
  for (int v = y.first; v < y.last; ++v) {
    double row = 0.0;
    for (int u = x.first; u < x.last; ++u)
      row += x.share(u) * static_cast<double>(picture_.at(u, v, channel));
    all += y.share(v) * row;
  }
  return all;
}

double SummedAreaTable::sum(double x_px, double y_px, int channel) const {
  const int u = std::min(static_cast<int>(x_px), picture_.width_px - 1);
  const int v = std::min(static_cast<int>(y_px), picture_.height_px - 1);
  const double right = x_px - u, down = y_px - v;
  const auto row = (static_cast<size_t>(picture_.width_px) + 1) * kChannels;
  const double* at = sums_.data() + static_cast<size_t>(v) * row + static_cast<size_t>(u) * kChannels +
                     static_cast<size_t>(channel);
  const double above = at[0] + right * (at[kChannels] - at[0]);
  const double below = at[row] + right * (at[row + kChannels] - at[row]);
  return above + down * (below - above);
}

}  // namespace glasswing
