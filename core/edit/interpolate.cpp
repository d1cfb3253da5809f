#include "core/edit/interpolate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "core/edit/mode_reduction.h"

namespace glasswing {
namespace {

constexpr float kSamePlace = 3.0f;  // standard deviations of both footprints
constexpr float kNearlyAsWell = 1.5f, kAgrees = 0.01f;

float distance_of(const Mode& a, const Mode& b) {
  const float width = 0.5f * (a.xx_px2 + a.yy_px2 + b.xx_px2 + b.yy_px2) + 1.0f / 6.0f;
  return std::hypot(a.x_px - b.x_px, a.y_px - b.y_px) / std::sqrt(width);
}

struct Between {
  std::array<float, kChannels> foreground{};
  float coverage = 0.0f;
  std::vector<std::vector<Mode>> modes;  // by stored channel
  float apart = 0.0f;                    // light by which the two sides differ
};

Mode mean_of(const Mode& a, const Mode& b, float share) {
  const auto mean = [share](float of_a, float of_b) { return of_a + share * (of_b - of_a); };
  Mode mode = a;
  mode.weight = mean(a.weight, b.weight);
  mode.x_px = mean(a.x_px, b.x_px);
  mode.y_px = mean(a.y_px, b.y_px);
  mode.xx_px2 = mean(a.xx_px2, b.xx_px2);
  mode.xy_px2 = mean(a.xy_px2, b.xy_px2);
  mode.yy_px2 = mean(a.yy_px2, b.yy_px2);
  return mode;
}

// The modes between two pixels, of which `share` is b's; adds to `apart` by how much light they differ.
std::vector<Mode> between(std::span<const Mode> a, std::vector<Mode> b, float share, float& apart) {
  std::vector<Mode> modes;
  for (const Mode& own : a) {
    if (own.weight == 0.0f) continue;
    const auto other = std::ranges::min_element(b, {}, [&](const Mode& mode) {
      return mode.weight > 0.0f && mode.texture == own.texture ? distance_of(own, mode) : INFINITY;
    });
    if (other == b.end() || other->weight == 0.0f || other->texture != own.texture ||
        distance_of(own, *other) > kSamePlace) {
      modes.push_back(scaled(own, 1.0f - share));
      apart += own.weight;
      continue;
    }
    apart += std::abs(own.weight - other->weight) +
             std::min(own.weight, other->weight) * std::min(1.0f, distance_of(own, *other));
    modes.push_back(mean_of(own, *other, share));
    *other = Mode{};
  }
  for (const Mode& left : b) {
    if (left.weight == 0.0f) continue;
    modes.push_back(scaled(left, share));
    apart += left.weight;
  }
  return modes;
}

Between between(const Matte& matte, int ax, int ay, int bx, int by) {
  Between both{.foreground = {},
               .coverage = 0.5f * (matte.coverage(ax, ay) + matte.coverage(bx, by)),
               .modes = {},
               .apart = std::abs(matte.coverage(ax, ay) - matte.coverage(bx, by))};
  for (size_t c = 0; c < kChannels; ++c) {
    const float a = matte.foreground(ax, ay)[c], b = matte.foreground(bx, by)[c];
    both.foreground[c] = 0.5f * (a + b);
    both.apart += std::abs(a - b);
  }
  for (int c = 0; c < (matte.is_colourless() ? 1 : kChannels); ++c) {
    const std::span<const Mode> b = matte.modes(bx, by, c);
    both.modes.push_back(between(matte.modes(ax, ay, c), {b.begin(), b.end()}, 0.5f, both.apart));
  }
  return both;
}

std::vector<Between> pairs_around(const Matte& matte, int x, int y) {
  const auto is_good = [&](int at_x, int at_y) {
    return at_x >= 0 && at_x < matte.width_px() && at_y >= 0 && at_y < matte.height_px() &&
           matte.flags(at_x, at_y) == kFlagNone;
  };
  std::vector<Between> pairs;
  for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}, {1, -1}}) {
    if (is_good(x - dx, y - dy) && is_good(x + dx, y + dy))
      pairs.push_back(between(matte, x - dx, y - dy, x + dx, y + dy));
  }
  std::ranges::sort(pairs, {}, &Between::apart);
  if (!pairs.empty()) {
    const float most = kNearlyAsWell * pairs.front().apart + kAgrees;
    std::erase_if(pairs, [most](const Between& pair) { return pair.apart > most; });
  }
  return pairs;
}

void put(const std::vector<Between>& pairs, bool boxes, int x, int y, Matte& matte) {
  Between mean = pairs.front();
  for (size_t i = 1; i < pairs.size(); ++i) {
    const float share = 1.0f / static_cast<float>(i + 1);
    mean.coverage += share * (pairs[i].coverage - mean.coverage);
    for (size_t c = 0; c < kChannels; ++c)
      mean.foreground[c] += share * (pairs[i].foreground[c] - mean.foreground[c]);
    for (size_t c = 0; c < mean.modes.size(); ++c)
      mean.modes[c] = between(mean.modes[c], pairs[i].modes[c], share, mean.apart);
  }
  matte.coverage(x, y) = mean.coverage;
  matte.foreground(x, y) = mean.foreground;
  for (size_t c = 0; c < mean.modes.size(); ++c) {
    reduce_modes(mean.modes[c], matte.modes_per_channel(), boxes);
    const std::span<Mode> own = matte.modes(x, y, static_cast<int>(c));
    std::ranges::fill(own, Mode{});
    for (size_t m = 0; m < std::min(own.size(), mean.modes[c].size()); ++m) {
      own[m] = mean.modes[c][m];
      own[m].weight_sd = own[m].centre_sd_px = 0.0f;
    }
  }
}

}  // namespace

void interpolate_pixels(Matte& matte, std::uint8_t flags) {
  const bool boxes = matte.metadata.footprint() == kBoxFootprint;
  std::vector<std::pair<int, int>> made;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      if ((matte.flags(x, y) & flags) == 0) continue;
      const std::vector<Between> pairs = pairs_around(matte, x, y);
      if (pairs.empty()) continue;
      put(pairs, boxes, x, y, matte);
      made.emplace_back(x, y);
    }
  }
  // Flags last: none is made of one that was made.
  for (const auto& [x, y] : made)
    matte.flags(x, y) = static_cast<std::uint8_t>((matte.flags(x, y) & ~flags) | kFlagFilled);
}

}  // namespace glasswing
