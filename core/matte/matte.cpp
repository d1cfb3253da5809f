#include "core/matte/matte.h"

#include <algorithm>

namespace glasswing {

Matte::Matte(int x0_px, int y0_px, int width_px, int height_px, int modes_per_channel, bool colourless)
    : x0_px_(x0_px),
      y0_px_(y0_px),
      width_px_(width_px),
      height_px_(height_px),
      modes_per_channel_(modes_per_channel),
      mode_channels_(colourless ? 1 : kChannels) {
  assert(width_px > 0 && height_px > 0 && modes_per_channel >= 1 && modes_per_channel <= kMaxModes);
  const size_t pixel_count = static_cast<size_t>(width_px) * static_cast<size_t>(height_px);
  foreground_.resize(pixel_count);
  coverage_.resize(pixel_count);
  flags_.resize(pixel_count);
  modes_.resize(pixel_count * mode_channels_ * static_cast<size_t>(modes_per_channel));
}

void Matte::put(const Matte& tile) {
  for (int y = 0; y < tile.height_px(); ++y) {
    for (int x = 0; x < tile.width_px(); ++x)
      copy_pixel(tile, x, y, tile.x0_px() + x - x0_px_, tile.y0_px() + y - y0_px_);
  }
}

void Matte::copy_pixel(const Matte& from, int from_x, int from_y, int x, int y) {
  foreground(x, y) = from.foreground(from_x, from_y);
  coverage(x, y) = from.coverage(from_x, from_y);
  flags(x, y) = from.flags(from_x, from_y);
  for (int c = 0; c < static_cast<int>(mode_channels_); ++c)
    std::ranges::copy(from.modes(from_x, from_y, c), modes(x, y, c).begin());
}

PixelCount count_pixels(const Matte& matte) {
  PixelCount count;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if ((matte.flags(x, y) & kFlagNoData) != 0) ++count.unsolved;
      if (matte.coverage(x, y) <= 0.0f) continue;
      ++count.object;
      if (matte.flags(x, y) != kFlagNone) ++count.flagged;
    }
  }
  return count;
}

}  // namespace glasswing
