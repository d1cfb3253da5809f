// The difference of two pictures:
//
//   rms = sqrt(mean over pixels and channels of (a - b)^2);   psnr = -20 log10(rms)     (peak 1.0)
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

struct Difference {
  double rms = 0.0;      // linear radiance
  double psnr_db = 0.0;  // infinite for equal pictures
  std::int64_t pixel_count = 0;
};

// Over all pixels, or those with a coverage above 0.5 in `matte` (may be null). INVALID_ARGUMENT: sizes
// differ, or no pixel is covered.
absl::StatusOr<Difference> difference_of(const RadianceImage& a, const RadianceImage& b, const Matte* matte);

// `a` with a gain and an offset per channel that bring it closest to `b` (least squares over the same
// pixels), for pictures of different exposure or ambient light. Errors: as in difference_of().
absl::StatusOr<RadianceImage> matched(const RadianceImage& a, const RadianceImage& b, const Matte* matte);

}  // namespace glasswing
