#include "core/matte/fill_unsolved.h"

#include <array>
#include <cassert>
#include <utility>
#include <vector>

namespace glasswing {
namespace {

class Filler {
 public:
  Filler(std::span<const std::uint8_t> unsolved, RadianceImage& picture)
      : picture_(picture),
        known_(static_cast<size_t>(picture.width_px) * static_cast<size_t>(picture.height_px)) {
    for (int y = 0; y < picture.height_px; ++y) {
      for (int x = 0; x < picture.width_px; ++x) {
        known_[index(x, y)] = unsolved[index(x, y)] == 0;
        if (!known_[index(x, y)]) open_.emplace_back(x, y);
      }
    }
  }

  // Fills the open pixels next to known ones; returns their number.
  std::int64_t fill_rim() {
    std::vector<std::pair<int, int>> filled, open;
    for (const auto& [x, y] : open_) (fill(x, y) ? filled : open).emplace_back(x, y);
    for (const auto& [x, y] : filled) known_[index(x, y)] = true;
    open_ = std::move(open);
    return static_cast<std::int64_t>(filled.size());
  }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(picture_.width_px) + static_cast<size_t>(x);
  }
  bool is_known(int x, int y) const {
    return x >= 0 && x < picture_.width_px && y >= 0 && y < picture_.height_px && known_[index(x, y)];
  }
  bool fill(int x, int y) {
    std::array<float, kChannels> sum{};
    int count = 0;
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) {
        if (!is_known(u, v)) continue;
        ++count;
        for (int c = 0; c < kChannels; ++c) sum[static_cast<size_t>(c)] += picture_.at(u, v, c);
      }
    }
    for (int c = 0; c < kChannels && count > 0; ++c)
      picture_.at(x, y, c) = sum[static_cast<size_t>(c)] / static_cast<float>(count);
    return count > 0;
  }

  RadianceImage& picture_;
  std::vector<bool> known_;
  std::vector<std::pair<int, int>> open_;
};

}  // namespace

void note_unsolved(const Matte& rows, int to, std::span<std::uint8_t> unsolved) {
  const auto width = static_cast<size_t>(rows.width_px());
  for (int y = 0; y < rows.height_px(); ++y) {
    std::uint8_t* const row = &unsolved[static_cast<size_t>(to + y) * width];
    for (int x = 0; x < rows.width_px(); ++x) row[x] = (rows.flags(x, y) & kFlagNoData) != 0 ? 1 : 0;
  }
}

std::int64_t fill_unsolved(std::span<const std::uint8_t> unsolved, RadianceImage& composite) {
  assert(3 * unsolved.size() == composite.samples.size());
  Filler filler(unsolved, composite);
  std::int64_t all = 0;
  while (const std::int64_t rim = filler.fill_rim()) all += rim;
  return all;
}

}  // namespace glasswing
