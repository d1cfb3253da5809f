#include "core/edit/fill.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/edit/mode_reduction.h"

namespace glasswing {
namespace {

struct Place {
  int x = 0, y = 0;
};

class Filler {
 public:
  Filler(Matte& matte, std::uint8_t flags)
      : matte_(matte),
        flags_(flags),
        boxes_(matte.metadata.footprint() == kBoxFootprint),
        known_(static_cast<size_t>(matte.width_px()) * static_cast<size_t>(matte.height_px())) {
    for (int y = 0; y < matte.height_px(); ++y) {
      for (int x = 0; x < matte.width_px(); ++x) {
        known_[index(x, y)] = (matte.flags(x, y) & flags) == 0;
        if (!known_[index(x, y)]) open_.push_back({x, y});
      }
    }
  }

  // Fills the open pixels next to known ones; returns their number.
  std::int64_t fill_rim() {
    std::vector<Place> filled, open;
    for (const Place& place : open_) (fill(place) ? filled : open).push_back(place);
    for (const Place& place : filled) known_[index(place.x, place.y)] = true;
    open_ = std::move(open);
    return std::ssize(filled);
  }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(matte_.width_px()) + static_cast<size_t>(x);
  }

  std::vector<Place> known_around(const Place& place) const {
    std::vector<Place> around;
    for (int y = std::max(place.y - 1, 0); y <= std::min(place.y + 1, matte_.height_px() - 1); ++y) {
      for (int x = std::max(place.x - 1, 0); x <= std::min(place.x + 1, matte_.width_px() - 1); ++x) {
        if (known_[index(x, y)]) around.push_back({x, y});
      }
    }
    return around;
  }

  bool fill(const Place& place) {
    const std::vector<Place> around = known_around(place);
    if (around.empty()) return false;
    const float share = 1.0f / static_cast<float>(around.size());
    std::array<float, kChannels> foreground{};
    float coverage = 0.0f;
    for (const auto& [x, y] : around) {
      coverage += share * matte_.coverage(x, y);
      for (size_t c = 0; c < kChannels; ++c) foreground[c] += share * matte_.foreground(x, y)[c];
    }
    matte_.foreground(place.x, place.y) = foreground;
    matte_.coverage(place.x, place.y) = coverage;
    std::uint8_t& flags = matte_.flags(place.x, place.y);
    flags = static_cast<std::uint8_t>((flags & ~flags_) | kFlagFilled);
    for (int c = 0; c < (matte_.is_colourless() ? 1 : kChannels); ++c) {
      modes_.clear();
      for (const auto& [x, y] : around) {
        for (const Mode& mode : matte_.modes(x, y, c)) modes_.push_back(scaled(mode, share));
      }
      reduce_modes(modes_, matte_.modes_per_channel(), boxes_);
      const std::span<Mode> own = matte_.modes(place.x, place.y, c);
      std::ranges::fill(own, Mode{});
      for (size_t m = 0; m < std::min(own.size(), modes_.size()); ++m) {
        own[m] = modes_[m];
        own[m].weight_sd = own[m].centre_sd_px = 0.0f;
      }
    }
    return true;
  }

  Matte& matte_;
  const std::uint8_t flags_;
  const bool boxes_;
  std::vector<bool> known_;
  std::vector<Place> open_;
  std::vector<Mode> modes_;
};

}  // namespace

std::int64_t fill(Matte& matte, std::uint8_t flags) {
  Filler filler(matte, flags);
  std::int64_t all = 0;
  while (const std::int64_t rim = filler.fill_rim()) all += rim;
  return all;
}

}  // namespace glasswing
