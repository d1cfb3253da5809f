// One step of structural adaptive smoothing (Polzehl and Spokoiny 2006, "Propagation-separation approach for
// local likelihood estimation"), with planes instead of constants: around each pixel i
//
//   minimise over (a, g)   sum_j k_ij I_j |z_j - a - g (j - i)|^2,   z = (x, y, rho)
//
// I_j is the information of sample j. k_ij decreases with distance, 1 - |j - i|^2 / (r + 1)^2, and with the
// disagreement between the previous step's estimate, continued from i to j, and that at j:
//
//   s_ij = |a_j - a_i - g_i (j - i)|^2 / (v_j + v_i (1 + |j - i|^2 / spread_i)),   summed over x, y, rho
//
// which is chi^2 of three degrees of freedom if both belong to one piece: full weight up to 6 (nine of ten),
// none from 12 on (99.3 %). A window thus grows over its piece and stops at the edges.
#pragma once

#include "solver/ramp/smoother/ramp_smoother_planes.h"

namespace glasswing::internal {

struct SmoothStep {
  SmoothArea area;
  int radius = 1;         // px, at most 8
  float rho_info = 0.0f;  // of one sample of rho
  const SmoothSamples* samples = nullptr;
  const SmoothState* before = nullptr;  // null: the samples themselves
  SmoothState* after = nullptr;         // of the same size; not `before`
};

// A step at full resolution after others at half: at each pixel the planes of the four surrounding coarse
// pixels replace its own, as far as they agree with it (s_ij above); among those that agree, the likelier
// ones.
struct RefineStep {
  SmoothStep fine;         // of its state after, only values and info
  SmoothArea coarse_area;  // coarse pixel (x, y) is (2 x, 2 y) to (2 x + 1, 2 y + 1) of the picture
  const SmoothState* coarse = nullptr;
};

// Rows [first, last) of the area.
void smooth_rows(const SmoothStep& step, int first, int last);
void refine_rows(const RefineStep& step, int first, int last);

}  // namespace glasswing::internal
