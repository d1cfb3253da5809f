#pragma once

namespace glasswing {

// How well a finished matte is known, of a sample of the object's pixels.
struct MatteQuality {
  double poor_fit = 0.0;  // share of those whose residual exceeds the noise
  // Medians of their strongest footprints, px of the monitor; 0: unknown.
  double error_px = 0.0;  // predicted standard error of the centre
  double width_px = 0.0;  // standard deviation
};

}  // namespace glasswing
