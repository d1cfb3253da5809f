#include "core/composite/fill_unsolved.h"

#include <cassert>
#include <utility>
#include <vector>

#include "core/matte/rim_fill.h"

namespace glasswing {
void note_unsolved(const Matte& rows, int to, std::span<std::uint8_t> unsolved) {
  const size_t width = rows.width_px();
  for (int y = 0; y < rows.height_px(); ++y) {
    std::uint8_t* const row = &unsolved[static_cast<size_t>(to + y) * width];
    for (int x = 0; x < rows.width_px(); ++x) row[x] = (rows.flags(x, y) & kFlagNoData) != 0 ? 1 : 0;
  }
}

std::int64_t fill_unsolved(std::span<const std::uint8_t> unsolved, RadianceImage& composite) {
  assert(3 * unsolved.size() == composite.samples.size());
  std::vector<bool> known(unsolved.size());
  for (size_t i = 0; i < unsolved.size(); ++i) known[i] = unsolved[i] == 0;
  const auto fill = [&](const PixelPlace& place, std::span<const PixelPlace> around) {
    for (int c = 0; c < kChannels; ++c) {
      float sum = 0.0f;
      for (const PixelPlace& other : around) sum += composite.at(other.x, other.y, c);
      composite.at(place.x, place.y, c) = sum / static_cast<float>(around.size());
    }
  };
  return fill_from_rim(composite.width_px, composite.height_px, std::move(known), fill);
}

}  // namespace glasswing
