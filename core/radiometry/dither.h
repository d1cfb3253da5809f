// Quantises a picture to a monitor's codes by error diffusion (Floyd and Steinberg 1976) in radiance: with T
// the wanted radiance and L the tone curve,
//
//   v = T + (7 e_left + 1 e_above_left + 5 e_above + 3 e_above_right) / 16
//   code: nearest to v,   e = v - L(code)
//
// A sample whose wanted radiance is 0 or 1 (to 2^-21) always has code 0 or the highest, and errors handed to
// it are dropped: black stays black, and is fast. No other error is lost, except over the picture's edges. So
// the mean over any area is off by at most half a code step for each pixel along its border and the borders
// of such samples within it. Errors are those of radiance, not of code, so the result is unbiased in light.
// tests/bench/dither_bench compares it with threshold matrices.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {

class Dither {
 public:
  // r, g, b, all of the same bit depth.
  explicit Dither(const std::array<ToneCurve, 3>& curves);

  // Writes row y, in [0, height), of a picture's radiances to `row`: 3 width values, r, g, b interleaved.
  using Rows = std::function<void(int y_px, std::span<float> row)>;

  // Radiances are clamped to [0, 1] (NaN is 0) and rounded to 2^-20 of full scale. Rows are requested once,
  // from the top. `codes` has 3 width height elements.
  void codes(const Rows& radiance, int width_px, std::span<std::uint16_t> codes) const;
  Image<std::uint16_t> codes(const RadianceImage& radiance) const;

 private:
  int highest_;                         // code
  std::vector<std::uint32_t> nearest_;  // [channel][radiance, 14 bits]: radiance of 20 bits, code of 12
};

}  // namespace glasswing
