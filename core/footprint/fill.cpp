#include "core/footprint/fill.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/footprint/mode_reduction.h"
#include "core/matte/rim_fill.h"

namespace glasswing {
namespace {

class Filler {
 public:
  Filler(Matte& matte, std::uint8_t flags)
      : matte_(matte), flags_(flags), boxes_(matte.metadata.footprint() == kBoxFootprint) {}

  void fill(const PixelPlace& place, std::span<const PixelPlace> around) {
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
    for (int c = 0; c < (matte_.is_colourless() ? 1 : kChannels); ++c) fill_modes(place, around, c, share);
  }

 private:
  void fill_modes(const PixelPlace& place, std::span<const PixelPlace> around, int channel, float share) {
    modes_.clear();
    for (const auto& [x, y] : around) {
      for (const Mode& mode : matte_.modes(x, y, channel)) modes_.push_back(scaled(mode, share));
    }
    reduce_modes(modes_, matte_.modes_per_channel(), boxes_);
    const std::span<Mode> own = matte_.modes(place.x, place.y, channel);
    std::ranges::fill(own, Mode{});
    for (size_t m = 0; m < std::min(own.size(), modes_.size()); ++m) {
      own[m] = modes_[m];
      own[m].weight_sd = own[m].centre_sd_px = 0.0f;
    }
  }

  Matte& matte_;
  const std::uint8_t flags_;
  const bool boxes_;
  std::vector<Mode> modes_;
};

}  // namespace

std::int64_t fill(Matte& matte, std::uint8_t flags) {
  std::vector<bool> known;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) known.push_back((matte.flags(x, y) & flags) == 0);
  }
  Filler filler(matte, flags);
  return fill_from_rim(
      matte.width_px(), matte.height_px(), std::move(known),
      [&](const PixelPlace& place, std::span<const PixelPlace> around) { filler.fill(place, around); });
}

}  // namespace glasswing
