// How wide a pixel sees a thin stripe, lens, screen and the camera's own pixel together, from the background
// of a matte: the square waves without the object tell it for every pixel outside the silhouette.
//
// A footprint of covariance S on the monitor is J^-1 S J^-T in the camera's picture, where J is the slope of
// the footprints' centres, monitor px a camera px. The monitor's own flat pixels are not part of S
// (docs/matte.md).
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>

#include "core/frame/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// Medians over the pixels of a part of the picture; nothing where there are none.
struct BlurRegion {
  int pixel_count = 0;
  std::optional<std::array<double, 2>> monitor_px = {};  // sigma along x and y of the monitor
  std::optional<std::array<double, 2>> camera_px = {};   // and of the picture, where neighbours tell J
};

struct Blur {
  std::array<BlurRegion, 9> regions;  // thirds of the picture, row by row
  BlurRegion whole;
};

// Of pixels outside the silhouette without a flag. INVALID_ARGUMENT: there are none, or their widths were
// not measured.
absl::StatusOr<Blur> blur_of(const Matte& matte);

// The larger sigma of each of these pixels, monitor px, from dark blue for 0 over red to pale yellow for
// `max_px`, with all colours in a bar below; the other pixels are gray.
RadianceImage blur_picture(const Matte& matte, double max_px);

}  // namespace glasswing
