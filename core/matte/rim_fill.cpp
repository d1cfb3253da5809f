#include "core/matte/rim_fill.h"

#include <algorithm>
#include <utility>

namespace glasswing {

std::int64_t fill_from_rim(
    int width_px, int height_px, std::vector<bool> known,
    absl::FunctionRef<void(const PixelPlace& place, std::span<const PixelPlace> around)> fill) {
  const auto index = [width_px](int x, int y) { return static_cast<size_t>(y) * width_px + x; };
  const auto for_neighbours = [&](const PixelPlace& place, auto each) {
    for (int y = std::max(place.y - 1, 0); y <= std::min(place.y + 1, height_px - 1); ++y) {
      for (int x = std::max(place.x - 1, 0); x <= std::min(place.x + 1, width_px - 1); ++x) each(x, y);
    }
  };
  // Each round fills the unknown pixels beside known ones: at first, and then beside those just filled.
  std::vector<PixelPlace> rim, next, around;
  std::vector<bool> on_rim(known.size());
  const auto add = [&](int x, int y, std::vector<PixelPlace>& to) {
    if (known[index(x, y)] || on_rim[index(x, y)]) return;
    on_rim[index(x, y)] = true;
    to.push_back({x, y});
  };
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      if (known[index(x, y)]) for_neighbours({x, y}, [&](int nx, int ny) { add(nx, ny, rim); });
    }
  }
  std::int64_t count = 0;
  for (; !rim.empty(); std::swap(rim, next)) {
    for (const PixelPlace& place : rim) {
      around.clear();
      for_neighbours(place, [&](int x, int y) {
        if (known[index(x, y)]) around.push_back({x, y});
      });
      fill(place, around);
    }
    count += std::ssize(rim);
    for (const PixelPlace& place : rim) known[index(place.x, place.y)] = true;
    next.clear();
    for (const PixelPlace& place : rim) for_neighbours(place, [&](int x, int y) { add(x, y, next); });
  }
  return count;
}

}  // namespace glasswing
