// A matte's strongest path as an STMap, which compositors warp a picture by (Nuke and Natron STMap, Blender
// Map UV, oiiotool --st_warp):
//
//   s = x / width,  t = 1 - y / height       of the mode's centre (x, y) on a monitor of width x height px
//
// so that the middle of the monitor's bottom left pixel is (0.5 / width, 0.5 / height). It is an
// approximation: one path, the same in all channels, without its width.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/matte/matte.h"

namespace glasswing {

// The mode of `channel` with the most weight on a monitor, or on any (`texture` -1); null: none has weight.
const Mode* strongest_mode(const Matte& matte, int x, int y, int channel, int texture = -1);

// Green, whose path lies in the middle of what glass disperses; or the channel whose strongest modes, all
// pixels together, have the most weight, where that is a tenth more than green's.
int strongest_channel(const Matte& matte, int texture = -1);

// An OpenEXR file of one part, float32, the matte's window:
//   R, G        s and t
//   B, A        1 where the centre lies on the monitor, else 0, as are R and G there
//   weight.R, .G, .B   R of each channel's strongest mode on the monitor
//   blur.Y      sigma, sqrt((xx + yy) / 2), monitor px
// INVALID_ARGUMENT: the matte's metadata has no such texture, or its size is not known.
absl::StatusOr<std::string> encode_stmap(const Matte& matte, int texture, int channel);

}  // namespace glasswing
