// Live composites of ramp frames in front of a picture. Tests compare them with core/composite/compositor.h
// on the same mattes:
//
//   C = f W + (1 - alpha) B + rho M(T, A(c, w))                         (Chuang et al. 2000, eq. 30)
#pragma once

#include <cstdint>
#include <vector>

#include "core/composite/summed_area_table.h"
#include "core/image/image.h"
#include "core/matte/matte.h"
#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

// A picture behind the object: T, and its view by the camera without the object.
class RampBackground {
 public:
  // `picture`: linear radiance, of the monitor's size. `empty_stage`: the matte of a frame without the
  // object.
  RampBackground(const RadianceImage& picture, const Matte& empty_stage, int thread_count);

 private:
  friend std::vector<std::uint8_t> composite(const RampFrame&, const RampBackground&, int);

  FastSummedAreaTable table_;
  RadianceImage behind_;               // B
  std::vector<std::uint8_t> encoded_;  // the same in 8-bit sRGB
};

// Returns r, g, b by rows, 8-bit sRGB. The frame has the empty stage's size. The result does not depend on
// `thread_count` (0: all cores).
std::vector<std::uint8_t> composite(const RampFrame& frame, const RampBackground& background,
                                    int thread_count);

}  // namespace glasswing
