#include "solver/corrections/disturbed_pixels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace glasswing {
namespace {

constexpr double kMaxChange = 0.05, kContrast = 0.5;

// An upper bound of how much the light of two pixels differs over such a picture: light that only one of them
// has, and an edge between their footprints that shows on only one.
double difference_of(const Matte& matte, int ax, int ay, int bx, int by, int channel, double share) {
  const size_t c = channel;
  double difference =
      share * std::abs(static_cast<double>(matte.foreground(ax, ay)[c] - matte.foreground(bx, by)[c]));
  for (const Mode& own : matte.modes(ax, ay, channel)) {
    if (own.weight == 0.0f) continue;
    double least = kContrast * own.weight * std::min(share, 1.0);  // unlike all of the other's
    for (const Mode& other : matte.modes(bx, by, channel)) {
      if (other.weight == 0.0f || other.texture != own.texture) continue;
      const double width = std::sqrt(0.5 * static_cast<double>(own.xx_px2 + own.yy_px2) + 1.0 / 12.0);
      const double away = share * std::hypot(static_cast<double>(own.x_px - other.x_px),
                                             static_cast<double>(own.y_px - other.y_px));
      const double seen = std::erf(away / width / (2.0 * std::numbers::sqrt2));
      least = std::min(least, kContrast * (own.weight * seen +
                                           share * std::abs(static_cast<double>(own.weight - other.weight))));
    }
    difference += least;
  }
  return difference;
}

}  // namespace

void flag_disturbed(const Disturbance& disturbance, Matte& matte) {
  if (disturbance.moved_px == 0.0) return;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      bool changes = false, at_object = matte.coverage(x, y) > 0.0f;
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const int at_x = x + dx, at_y = y + dy;
        if (at_x < 0 || at_x >= matte.width_px() || at_y < 0 || at_y >= matte.height_px()) continue;
        at_object = at_object || matte.coverage(at_x, at_y) > 0.0f;
        for (int c = 0; c < kChannels && !changes; ++c)
          changes = difference_of(matte, x, y, at_x, at_y, c, disturbance.moved_px) > kMaxChange;
      }
      if (changes && (at_object || !disturbance.object_only)) matte.flags(x, y) |= kFlagDisturbed;
    }
  }
}

}  // namespace glasswing
