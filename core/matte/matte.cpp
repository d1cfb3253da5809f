#include "core/matte/matte.h"

namespace glasswing {

Matte::Matte(int x0_px, int y0_px, int width_px, int height_px, int modes_per_channel)
    : x0_px_(x0_px),
      y0_px_(y0_px),
      width_px_(width_px),
      height_px_(height_px),
      modes_per_channel_(modes_per_channel) {
  assert(width_px > 0 && height_px > 0 && modes_per_channel >= 1 && modes_per_channel <= kMaxModes);
  const size_t pixel_count = static_cast<size_t>(width_px) * static_cast<size_t>(height_px);
  foreground_.resize(pixel_count);
  coverage_.resize(pixel_count);
  flags_.resize(pixel_count);
  modes_.resize(pixel_count * kChannels * static_cast<size_t>(modes_per_channel));
}

}  // namespace glasswing
