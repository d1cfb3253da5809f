// A picture's codes for a monitor of few bits, with what each pixel's code is off in radiance handed on to
// pixels not yet done (error diffusion, Floyd and Steinberg 1976): with T the wanted radiance and L the tone
// curve,
//
//   v = T + (7 e_left + 1 e_above_left + 5 e_above + 3 e_above_right) / 16,   code: nearest to v,   e = v -
//   L(code)
//
// A primary that is wanted 0 or 1 (to 2^-21) has its code whatever is around it, and what is handed to it is
// lost: black stays black, and costs little. Otherwise nothing is lost but over the picture's edges. So the
// mean over any area is off by no more than what passes its border and the borders of such surfaces in it: at
// most half a step between two codes for each pixel there. Radiances are mixed, not codes, which makes it
// unbiased in light. tests/bench/dither_bench compares it with threshold matrices.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/frame/image.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {

class Dither {
 public:
  // r, g, b, of as many bits.
  explicit Dither(const std::array<ToneCurve, 3>& curves);

  // Puts row y, in [0, height), of a picture's radiances into `row`: r, g, b interleaved, 3 width of them.
  using Rows = std::function<void(int y_px, std::span<float> row)>;

  // Radiances in [0, 1] (beyond, the nearest end; NaN is 0), taken to 2^-20 of full scale. A surface of
  // radiance 0 is of code 0, one of 1 of the highest. Rows are asked for once, from the top. `codes` has 3
  // width height of them.
  void codes(const Rows& radiance, int width_px, std::span<std::uint16_t> codes) const;
  Image<std::uint16_t> codes(const RadianceImage& radiance) const;

 private:
  class Row;
  static void run(std::span<Row> rows, size_t from, size_t to);

  int highest_;                         // code
  std::vector<std::uint32_t> nearest_;  // [radiance, 14 bits][channel]: radiance of 20 bits, code of 12
};

}  // namespace glasswing
