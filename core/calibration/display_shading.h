// Measures the shading of a monitor, v1::Uniformity. The ramp (core/pattern/pattern.h) shows where on the
// monitor each camera pixel looks, white how bright that point is:
//
//   u = (r - .1) / .8,   v = (g - .1) / .8,      r, g: codes, from the pixel's light through the response
//   light = mean over channels of (white - black) / (their mean over the screen) / the camera's shading
//
// averaged in each cell of a grid, 1 in the centre. The result includes the error of the camera's shading, or
// all of it if that was not measured, since one view of one screen cannot separate the two; and the monitor's
// dimming at oblique angles.
#pragma once

#include <optional>

#include "core/calibration/screen_view.h"
#include "core/radiometry/shading.h"

namespace glasswing {

// 16 x 12 cells. Cells that the camera does not see are interpolated: each is the mean of its neighbours.
// None if it sees fewer than half of them.
std::optional<v1::Uniformity> measure_display_shading(const ScreenView& view, const DisplayResponse& response,
                                                      const Shading& camera);

}  // namespace glasswing
