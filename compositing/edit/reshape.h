// A matte's pixels moved and combined like a picture's: each edit commutes with compositing.
//
//   composite(cropped(matte)) = cropped(composite(matte)), and so for flipped and resized
//
// Modes stay where they are on their monitors. The first two hold exactly; the last holds as long as a
// pixel's modes are few enough to be kept (mode_reduction.h).
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "core/matte/matte.h"
#include "core/matte/matte_region.h"

namespace glasswing {

// A region of a matte's file, of which only this region is held in memory. INVALID_ARGUMENT: it is not within
// the picture. Other errors are those of decode_matte().
absl::StatusOr<Matte> crop_matte(std::string_view file, const MatteRegion& region);

// Left and right exchanged, or (`upside_down`) top and bottom.
Matte flipped(const Matte& matte, bool upside_down);

// Each pixel becomes the mean over its area (box filter) of light, modes and coverage; its flags are those of
// all pixels within it. Modes beyond `max_modes` are merged, which is possible only within one monitor. What
// the modes were fitted to is dropped from the metadata: it does not apply to combined pixels, so errors of
// composites are no longer known. Standard errors of modes assume independent pixels. INVALID_ARGUMENT: a
// side is not 1 to 16384 px, or `max_modes` is below the number of monitors or above kMaxModes.
// `thread_count` 0: all cores.
absl::StatusOr<Matte> resized(const Matte& matte, int width_px, int height_px, int max_modes = kMaxModes,
                              int thread_count = 0);

}  // namespace glasswing
