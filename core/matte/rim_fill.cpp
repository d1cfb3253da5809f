#include "core/matte/rim_fill.h"

#include <algorithm>
#include <utility>

namespace glasswing {

std::int64_t fill_from_rim(
    int width_px, int height_px, std::vector<bool> known,
    absl::FunctionRef<void(const PixelPlace& place, std::span<const PixelPlace> around)> fill) {
  const auto index = [width_px](int x, int y) {
    return static_cast<size_t>(y) * static_cast<size_t>(width_px) + static_cast<size_t>(x);
  };
  std::vector<PixelPlace> open, around;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      if (!known[index(x, y)]) open.push_back({x, y});
    }
  }
  std::int64_t count = 0;
  while (!open.empty()) {
    std::vector<PixelPlace> filled, left;
    for (const PixelPlace& place : open) {
      around.clear();
      for (int y = std::max(place.y - 1, 0); y <= std::min(place.y + 1, height_px - 1); ++y) {
        for (int x = std::max(place.x - 1, 0); x <= std::min(place.x + 1, width_px - 1); ++x) {
          if (known[index(x, y)]) around.push_back({x, y});
        }
      }
      if (!around.empty()) fill(place, around);
      (around.empty() ? left : filled).push_back(place);
    }
    if (filled.empty()) break;
    for (const PixelPlace& place : filled) known[index(place.x, place.y)] = true;
    count += std::ssize(filled);
    open = std::move(left);
  }
  return count;
}

}  // namespace glasswing
