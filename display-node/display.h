// The interface to the screens of one machine.
#pragma once

#include <absl/status/statusor.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/image/image.h"
#include "core/pattern/pattern.h"

namespace glasswing {

struct ScreenInfo {
  std::string name;
  int width_px = 0;
  int height_px = 0;
  int patch_rows = 0;  // the lowest of these rows, which show the id patch instead of the pattern
  int bits = 16;       // of a code, 8 to 16; code 0 is black, the highest is full scale
  double refresh_hz = 60.0;
  nanoseconds scanout{};  // from a picture's first row to its last
  nanoseconds lag{};      // from a row's scan-out until its light begins to change
  nanoseconds settle{};   // from then until its light has settled
};

inline MonitorSize pattern_size_of(const ScreenInfo& screen) {
  return {.width_px = screen.width_px, .height_px = screen.height_px - screen.patch_rows};
}

// ScreenInfo::patch_rows of a display's monitors.
struct PatchRows {
  // NOLINTNEXTLINE(google-explicit-constructor): a number alone is of every monitor
  PatchRows(int rows = 0) : of_all(rows) {}
  int of(const std::string& monitor) const {
    const auto own = of_one.find(monitor);
    return own == of_one.end() ? of_all : own->second;
  }
  int of_all;
  std::map<std::string, int> of_one;  // by monitor, instead
};

inline nanoseconds period_of(const ScreenInfo& screen) {
  return nanoseconds(std::llround(1e9 / screen.refresh_hz));
}

// The codes of a monitor's pixels, each with ScreenInfo::bits; null is black. Lists of pictures have one for
// each monitor, in the order of Display::screens().
using Picture = std::shared_ptr<const Image<std::uint16_t>>;

// A pixel as graphics memory holds it, blue in the lowest bits. `codes`: red, green, blue.
inline std::uint32_t packed(const std::uint16_t* codes, int bits) {
  return static_cast<std::uint32_t>(codes[0]) << (2 * bits) | static_cast<std::uint32_t>(codes[1]) << bits |
         codes[2];
}

// When the scan-out of a picture's first row began, CLOCK_MONOTONIC.
struct Scanout {
  nanoseconds start{};
  nanoseconds uncertainty{};
};

class Display {
 public:
  virtual ~Display() = default;
  virtual std::string backend() const = 0;
  virtual const std::vector<ScreenInfo>& screens() const = 0;
  // Shows the pictures from each monitor's first refresh at or after `at`, or as soon after it as possible.
  // Returns when all are on screen, with the times at which they really appeared. One caller at a time.
  virtual absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) = 0;
};

}  // namespace glasswing
