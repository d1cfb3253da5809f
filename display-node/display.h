// The seam to the screens of one machine.
#pragma once

#include <absl/status/statusor.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/frame/image.h"
#include "core/pattern/pattern.h"

namespace glasswing {

struct ScreenInfo {
  std::string name;
  int width_px = 0;
  int height_px = 0;
  int patch_rows = 0;  // of these, the lowest: they show the id patch and no pattern
  double refresh_hz = 60.0;
  nanoseconds scanout{};  // from a picture's first row to its last
  nanoseconds lag{};      // from a row's scan-out to its light
  nanoseconds settle{};   // until that light has settled
};

inline MonitorSize pattern_size_of(const ScreenInfo& screen) {
  return {.width_px = screen.width_px, .height_px = screen.height_px - screen.patch_rows};
}

inline nanoseconds period_of(const ScreenInfo& screen) {
  return nanoseconds(std::llround(1e9 / screen.refresh_hz));
}

// One picture for each monitor, in the order of Display::screens(); null is black.
using Picture = std::shared_ptr<const RadianceImage>;

// The code of a radiance, of 8 to 16 bits; a radiance that is not a number is black.
inline std::uint16_t code_of(float radiance, int bits) {
  // Two steps, so that a compiler sees a vector's maximum and minimum.
  const float positive = radiance > 0.0f ? radiance : 0.0f;
  const float light = positive < 1.0f ? positive : 1.0f;
  return static_cast<std::uint16_t>(static_cast<int>(light * static_cast<float>((1 << bits) - 1) + 0.5f));
}
inline std::uint8_t code_of(float radiance) {
  return static_cast<std::uint8_t>(code_of(radiance, 8));
}

// When a picture's first row left for the panel, CLOCK_MONOTONIC.
struct Scanout {
  nanoseconds start{};
  nanoseconds uncertainty{};
};

class Display {
 public:
  virtual ~Display() = default;
  virtual std::string backend() const = 0;
  virtual const std::vector<ScreenInfo>& screens() const = 0;
  // Puts the pictures on screen at each monitor's first refresh at or after `at`, or as soon after as it can,
  // and returns when they are there, with the truth about when. One caller at a time.
  virtual absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) = 0;
};

}  // namespace glasswing
