// Pixels that cannot be trusted because something moved between frames, and was not moved back: their light
// may come from a neighbour's place.
#pragma once

#include "core/matte/matte.h"

namespace glasswing {

// What moved during a session, uncorrected.
struct Disturbance {
  double moved_px = 0.0;     // of the camera's pixels; 0: nothing
  bool object_only = false;  // on a stage that stood still
};

// Sets kFlagDisturbed where moving by that much can change a pixel's light by more than 0.05 of full scale,
// judged by its four neighbours, for a picture with edges of half the contrast.
void flag_disturbed(const Disturbance& disturbance, Matte& matte);

}  // namespace glasswing
