// Light by brute force, the truth of the gate: patterns drawn pixel by pixel from their definitions
// (stimulus.proto), and footprints integrated over each flat pixel of a monitor. Shares nothing with the
// solver, core/pattern's drawing, core/sim or core/matte.
#pragma once

#include <vector>

#include "core/image/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing::gate {

struct Size {
  int width_px = 0, height_px = 0;
};

// The picture that a monitor of flat pixels shows: the stimulus at the centre of each.
RadianceImage drawn(const v1::Stimulus& stimulus, Size size);

// The part of a footprint's light that comes from one pixel of a monitor.
struct Share {
  int x = 0, y = 0;
  double part = 0.0;
};
using Shares = std::vector<Share>;

// A bivariate normal density.
struct Gaussian {
  double x_px = 0.0, y_px = 0.0;
  double xx_px2 = 0.0, xy_px2 = 0.0, yy_px2 = 0.0;
};
// By its standard deviations along and across a direction, from +x towards +y.
struct Slanted {
  double x_px = 0.0, y_px = 0.0, along_px = 1.0, across_px = 1.0, degrees = 0.0;
};
Gaussian gaussian(const Slanted& slanted);

// The integral over each pixel within six standard deviations, by three-point Gauss-Legendre in cells no
// wider than half the density's narrowest sigma: off by less than 1e-6.
Shares shares_of(const Gaussian& density, Size size);

// Of an upright box with uniform density: the overlap with each pixel.
struct Box {
  double x_px = 0.0, y_px = 0.0, width_px = 1.0, height_px = 1.0;
};
Shares shares_of(const Box& box, Size size);

// sum over pixels of share times light.
double seen(const Shares& shares, const RadianceImage& shown, int channel);

// The share that arrives: 1 minus what the edges cut.
double total(const Shares& shares);

}  // namespace glasswing::gate
