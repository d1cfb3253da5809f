// A pattern: the radiance of one stimulus as a pure function of the point on the monitor. This is the only
// definition: the display rasterises it, the simulator integrates it, the solver inverts it.
//
//   gauss_stripe  T(x, y) = peak exp(-(x cos phi + y sin phi - r)^2 / (2 sigma^2))
//   sinusoid      T(x, y) = peak (1 + cos(2 pi (x cos phi + y sin phi) / period - phase)) / 2
//   square        T = 1 where floor((t - offset) / bar_width) is even (odd if inverse), t = x or y
//   ramp          u = x/W, v = y/H: r = .1 + .8u, g = .1 + .8v, b = .9 - .4u - .4v   (r + g + 2b = 2)
//
// (Chuang et al. 2000, section 3.1 and figure 7; stripes have peak `peak` instead of unit area.)
// Monitor coordinates: px, origin at the outer corner of the top-left pixel, y down, centres at +0.5.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <span>
#include <variant>

#include "core/image/image.h"
#include "glasswing/v1/stimulus.pb.h"

namespace glasswing {

using Colour = std::array<float, 3>;  // linear radiance, r, g, b

struct MonitorSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const MonitorSize&) const = default;
};

class Pattern {
 public:
  // INVALID_ARGUMENT names the field, its value and what would be accepted. Photos are rejected: they are not
  // functions of position, and the owner of the picture handles them.
  static absl::StatusOr<Pattern> create(const v1::Stimulus& stimulus, MonitorSize size);

  // Radiance at a point.
  Colour radiance(double x_px, double y_px) const;

  // Radiance at the centre of every pixel of row y_px, in [0, height), equal to radiance() up to rounding of
  // a float. `row` holds 3 width values, r, g, b interleaved.
  void rasterise(int y_px, std::span<float> row) const;
  RadianceImage rasterised() const;

 private:
  struct Solid {};
  struct Stripe {
    double cos_phi, sin_phi, r_px, sigma_px;
  };
  struct Sinusoid {
    double cos_phi, sin_phi, period_px, phase_rad;
  };
  struct Square {
    bool along_x;
    double bar_width_px, offset_px;
    bool inverse;
  };
  struct Ramp {};
  using Shape = std::variant<Solid, Stripe, Sinusoid, Square, Ramp>;

  Pattern(Shape shape, Colour colour, MonitorSize size) : shape_(shape), colour_(colour), size_(size) {}
  void rasterise(const Stripe& stripe, int y_px, std::span<float> row) const;
  void rasterise(const Sinusoid& sinusoid, int y_px, std::span<float> row) const;

  Shape shape_;
  Colour colour_;
  MonitorSize size_;
};

}  // namespace glasswing
