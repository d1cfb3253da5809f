#include "core/matte/matte.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/matte/pixel_count.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {

Matte::Matte(int x0_px, int y0_px, int width_px, int height_px, int modes_per_channel, bool colourless)
    : x0_px_(x0_px),
      y0_px_(y0_px),
      width_px_(width_px),
      height_px_(height_px),
      modes_per_channel_(modes_per_channel),
      mode_channels_(colourless ? 1 : kChannels) {
  assert(width_px > 0 && height_px > 0 && modes_per_channel >= 1 && modes_per_channel <= kMaxModes);
  const size_t pixel_count = static_cast<size_t>(width_px) * height_px;
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
  if (!has_pyramids() && !from.has_pyramids()) return;
  for (int c = 0; c < kChannels; ++c) {
    const std::span<const PyramidFootprint> own = from.pyramids(from_x, from_y, c);
    const size_t key = kChannels * pixel(x, y) + c;
    if (own.empty()) {
      pyramids_.erase(key);
    } else {
      pyramids_[key].assign(own.begin(), own.end());
    }
  }
}

Mode mode_of(const Coefficient& coefficient, int texture) {
  const float sigma = std::ldexp(1.0f, coefficient.level);
  Mode mode;
  mode.weight = coefficient.weight;
  mode.x_px = sigma * static_cast<float>(2 * coefficient.column + 1);
  mode.y_px = sigma * static_cast<float>(2 * coefficient.row + 1);
  mode.xx_px2 = mode.yy_px2 = sigma * sigma;
  mode.texture = texture;
  return mode;
}

std::span<const PyramidFootprint> Matte::pyramids(int x, int y, int channel) const {
  const auto found = pyramids_.find(kChannels * pixel(x, y) + channel);
  return found == pyramids_.end() ? std::span<const PyramidFootprint>() : found->second;
}

std::span<PyramidFootprint> Matte::pyramids(int x, int y, int channel) {
  const auto found = pyramids_.find(kChannels * pixel(x, y) + channel);
  return found == pyramids_.end() ? std::span<PyramidFootprint>() : found->second;
}

bool Matte::has_pyramid(int x, int y) const {
  return has_pyramids() &&
         !(pyramids(x, y, 0).empty() && pyramids(x, y, 1).empty() && pyramids(x, y, 2).empty());
}

void Matte::add_pyramid(int x, int y, int channel, PyramidFootprint pyramid) {
  assert(!is_colourless());
  pyramids_[kChannels * pixel(x, y) + channel].push_back(std::move(pyramid));
}

std::vector<Mode> Matte::modes_without_pyramid(int x, int y, int channel) const {
  const std::span<const PyramidFootprint> own = pyramids(x, y, channel);
  std::vector<Mode> without;
  for (const Mode& mode : modes(x, y, channel)) {
    if (std::ranges::find(own, mode.texture, &PyramidFootprint::texture) == own.end())
      without.push_back(mode);
  }
  return without;
}

std::vector<Mode> Matte::modes_beside_pyramids(int x, int y, int channel) const {
  std::vector<Mode> beside = modes_without_pyramid(x, y, channel);
  for (const PyramidFootprint& pyramid : pyramids(x, y, channel)) {
    for (const Coefficient& light : pyramid.coefficients) {
      if (light.level < kPyramidLevels) continue;
      beside.push_back(modes(x, y, channel)[static_cast<size_t>(light.level - kPyramidLevels)]);
      beside.back().weight = light.weight;
    }
  }
  return beside;
}

std::vector<Mode> Matte::gaussians(int x, int y, int channel) const {
  std::vector<Mode> all = modes_beside_pyramids(x, y, channel);
  for (const PyramidFootprint& pyramid : pyramids(x, y, channel)) {
    for (const Coefficient& light : pyramid.coefficients) {
      if (light.level < kPyramidLevels) all.push_back(mode_of(light, pyramid.texture));
    }
  }
  return all;
}

float Matte::foreground_of_gaussians(int x, int y, int channel) const {
  float light = foreground(x, y)[channel];
  for (const PyramidFootprint& pyramid : pyramids(x, y, channel)) light += pyramid.foreground;
  return light;
}

void Matte::drop_pyramids() {
  const std::string lost = has_pyramids() ? lost_text(pyramid_share(*this), "modes") : "";
  for (const auto& [key, _] : pyramids_) flags_[key / kChannels] |= kFlagPoorFit;
  pyramids_.clear();
  if (metadata.footprint() != kPyramidFootprint) return;
  metadata.clear_footprint();
  if (!lost.empty()) metadata.add_warnings(lost);
}

PixelCount count_pixels(const Matte& matte) {
  return count_pixels(matte, MatteRegion{matte.x0_px(), matte.y0_px(), matte.width_px(), matte.height_px()});
}

PixelCount count_pixels(const Matte& matte, const MatteRegion& region) {
  PixelCount count;
  const int left = std::max(region.x_px - matte.x0_px(), 0), top = std::max(region.y_px - matte.y0_px(), 0),
            right = std::min(region.x_px + region.width_px - matte.x0_px(), matte.width_px()),
            bottom = std::min(region.y_px + region.height_px - matte.y0_px(), matte.height_px());
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      if ((matte.flags(x, y) & kFlagNoData) != 0) ++count.unsolved;
      if (matte.coverage(x, y) <= 0.0f) continue;
      ++count.object;
      if (matte.flags(x, y) == kFlagNone) continue;
      ++count.flagged;
      const auto worst = std::ranges::find_if(
          kNamedFlags, [&](const NamedFlag& named) { return (matte.flags(x, y) & named.flag) != 0; });
      if (worst != kNamedFlags.end()) ++count.worst[worst - kNamedFlags.begin()];
    }
  }
  return count;
}

PixelCount& PixelCount::operator+=(const PixelCount& other) {
  object += other.object;
  flagged += other.flagged;
  unsolved += other.unsolved;
  for (size_t i = 0; i < worst.size(); ++i) worst[i] += other.worst[i];
  return *this;
}

std::string flagged_text(const PixelCount& count) {
  if (count.flagged == 0) return "";
  const auto share = [&](std::int64_t pixels) {
    const double percent = 100.0 * static_cast<double>(pixels) / static_cast<double>(count.object);
    return percent < 0.05 ? "less than 0.1 %" : fmt::format("{:.1f} %", percent);
  };
  std::vector<std::string> parts;
  for (size_t i = 0; i < kNamedFlags.size(); ++i) {
    if (count.worst[i] > 0) parts.push_back(fmt::format("{} {}", share(count.worst[i]), kNamedFlags[i].name));
  }
  return fmt::format("{} of the object's pixels are flagged: {}", share(count.flagged),
                     fmt::join(parts, ", "));
}

}  // namespace glasswing
