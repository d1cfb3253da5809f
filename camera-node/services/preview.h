// What a person needs to see of a frame to frame and focus, and what a measurement needs of its light.
#pragma once

#include "core/frame/image.h"
#include "core/radiometry/frame_light.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// Everything but the exposure. `full_scale` is the sample at and above which the sensor clips.
v1::PreviewResponse preview_of(const Image16& image, int max_width_px, std::uint16_t full_scale);

// Everything but the sequence. Row means are of the light that `light` makes of the samples; those that it
// calls saturated count as clipped too.
v1::FrameLight light_of(const Image16& image, const FrameLight& light, std::uint16_t full_scale);

}  // namespace glasswing
