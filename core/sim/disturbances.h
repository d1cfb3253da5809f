// What happens to a simulated camera and its room while it runs; none of it is declared. Times count from the
// camera's first start.
#pragma once

#include <cstdint>

#include "core/image/image.h"

namespace glasswing {

struct Disturbances {
  // A knock: from `knock_s` on everything is shifted this much to the right and down, px.
  double knock_s = 0.0, knock_dx_px = 0.0, knock_dy_px = 0.0;
  double knock_lasts_s = 0.0;        // then all is as before; 0: it stays
  double creep_px_per_minute = 0.0;  // of the camera, which sinks: everything rises
  double vibration_px = 0.0;         // amplitude, along both axes, with 11 and 7 Hz
  // A lamp: light of this share of white everywhere, from `lamp_s` on.
  double lamp = 0.0, lamp_s = 0.0, lamp_lasts_s = 0.0;  // 0: it stays on
  double gain = 1.0, gain_s = 0.0;                      // the camera's gain from `gain_s` on
  double warm_up = 0.0, warm_up_s = 120.0;  // share by which light falls in the end, with this time constant
  double flare = 0.0;                       // share of each picture's light that spreads over it evenly
  double bad_pixels = 0.0;                  // share of samples that are stuck at black or at full scale
  std::uint64_t seed = 1;                   // of bad pixels

  bool operator==(const Disturbances&) const = default;
};

// Changes what the camera sees at this time, s.
void disturb(const Disturbances& disturbances, double at_s, RadianceImage& radiance);
// Changes what its sensor records.
void spoil_pixels(const Disturbances& disturbances, Image16& frame);

}  // namespace glasswing
