// A matte for browsers: what an eye can see of it, in a few bytes a pixel (docs/web.md).
//
// Each pixel has F and a list of footprints, each with a weight a channel. Places, widths and weights are
// whole numbers:
//
//   x, y    in 1/16 px (coarser for monitors wider than 3,800 px), coarser by a power of two up to 1/16 of
//           the smaller width
//   widths  of the footprint's axes, sixteen steps an octave; the angle between them in 1/256 of half a turn
//   weight  in 1/512
//
// Channels whose footprints differ by less than an eighth of a width or a px, or by their errors, share one.
// Each kind of number is a plane of bytes: differences to the same entry of the previous pixel's list,
// deflated. Pixels that are not solved are filled (core/footprint/fill.h).
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "core/matte/matte_region.h"

namespace glasswing {

struct WebPlane {
  std::string name;
  std::uint64_t bytes = 0;  // deflated
};

struct WebMatte {
  MatteRegion region;                     // of the matte: what sees a monitor's picture
  double unit_px = 0.0, origin_px = 0.0;  // a place is origin + unit * number
  double foreground_scale = 1.0;          // F of code 255
  std::uint64_t footprint_count = 0;
  std::vector<WebPlane> planes;
  std::string bytes;  // of all planes, one behind the other
};

// INTERNAL: zlib failed.
absl::StatusOr<WebMatte> encode_web_matte(const Matte& matte);

// Steps of a width's code; code 0 is kNarrowest_px.
inline constexpr double kWidthsAnOctave = 16.0, kNarrowest_px = 1.0 / 16.0;
inline constexpr double kWeightUnit = 1.0 / 512.0;

}  // namespace glasswing
