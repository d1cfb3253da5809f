// The width at which a pixel sees a thin stripe: the blur of lens, screen and camera pixel together. It is
// measured on a matte's background, where square waves without the object give it for every pixel outside the
// silhouette.
//
// A footprint of covariance S on the monitor is J^-1 S J^-T in the camera's picture, where J is the Jacobian
// of the footprints' centres, in monitor px per camera px. S excludes the monitor's own flat pixels
// (docs/matte.md).
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// Medians over the pixels of a region; nullopt if there are none.
struct BlurRegion {
  int pixel_count = 0;
  std::optional<std::array<double, 2>> monitor_px = {};  // sigma along the monitor's x and y
  std::optional<std::array<double, 2>> camera_px =
      {};  // sigma along the picture's x and y, where neighbours give J
};

struct Blur {
  std::array<BlurRegion, 9> regions;  // thirds of the picture, row by row
  BlurRegion whole;
};

// Uses unflagged pixels outside the silhouette. INVALID_ARGUMENT: there are none, or their widths were not
// measured.
absl::StatusOr<Blur> blur_of(const Matte& matte);

// A map of the larger sigma for each of these pixels, in monitor px: dark blue is 0, then red, pale yellow is
// `max_px`. A bar below shows all colours; other pixels are gray.
RadianceImage blur_picture(const Matte& matte, double max_px);

}  // namespace glasswing
