// How evenly a monitor is lit. The ramp (core/pattern/pattern.h) tells each pixel of the camera where on the
// monitor it looks, and white how bright that place is:
//
//   u = (r - .1) / .8,   v = (g - .1) / .8,      r, g: codes, through the response from what the pixel sees
//   light = mean over channels of (white - black) / (their mean over the screen) / the camera's fall-off
//
// averaged in each cell of a grid, 1 in the middle. What a camera's fall-off is off by, or all of it where it
// was not measured, is in here: one picture of one screen cannot tell them apart. So is what the monitor
// sends less of to a side.
#pragma once

#include <optional>

#include "core/calibration/screen_view.h"
#include "core/radiometry/shading.h"

namespace glasswing {

// 16 x 12 cells. Those that the camera does not see are filled so that each is the mean of its neighbours.
// None: it sees less than half of them, or the ramp does not tell where it looks.
std::optional<v1::Uniformity> measure_display_shading(const ScreenView& view, const DisplayResponse& response,
                                            const Shading& camera);

}  // namespace glasswing
