// The light that a footprint of weight 1 receives from a picture, and how it changes with the footprint:
//
//   I = \int G(x; c, Sigma) T(x) dx      dI/dc = \int dG/dc T dx      dI/dSigma_xx = 1/2 d^2I/dc_x^2
//
// and likewise for xy (without the half) and yy: G obeys the equation of heat. The sums run over the samples
// of a pyramid's level (core/composite/pyramid.h) that are a little closer than the footprint is wide.
#pragma once

#include <vector>

#include "core/composite/pyramid.h"
#include "core/footprint/footprint.h"
#include "core/image/image.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

struct LightSlopes {
  double light = 0.0;  // I
  double by_x = 0.0, by_y = 0.0, by_xx = 0.0, by_xy = 0.0, by_yy = 0.0;
};

// A picture on a monitor. Thread-safe.
class LitMonitor {
 public:
  // `picture` has the monitor's size; `mix` converts it to the camera's channels.
  LitMonitor(const RadianceImage& picture, const PrimaryMix& mix, int texture, int thread_count);

  // Accurate to a few per cent; footprints below 0.6 px count as 0.6 px.
  LightSlopes slopes(const Footprint& mode, int channel) const;

 private:
  PyramidShape shape_;
  std::vector<float> samples_;
};

}  // namespace glasswing
