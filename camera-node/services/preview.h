// A frame reduced to a preview picture, for framing and focus, and to light per row, for measurements.
#pragma once

#include "core/image/image.h"
#include "core/image/mosaic.h"
#include "core/radiometry/frame_light.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// Sets all fields but the exposure. `full_scale`: the lowest sample at which the sensor clips.
absl::StatusOr<v1::PreviewResponse> preview_of(const Image16& frame, const std::optional<Mosaic>& mosaic,
                                               int max_width_px, std::uint16_t full_scale);

// Sets all fields but the sequence. Row means are of the light to which `light` converts samples; samples
// that it calls saturated also count as clipped.
v1::FrameLight light_of(const Image16& image, const FrameLight& light, std::uint16_t full_scale);

}  // namespace glasswing
