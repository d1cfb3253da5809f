// A sample of white or bars in the sums of joint_fit.h.
#pragma once

#include <array>

#include "core/footprint/cone_step.h"

namespace glasswing {

struct AreaRow {
  double rest = 0.0;                        // y_a - sum_m R_m S_m
  double floor = 0.0;                       // u_a
  double weight = 0.0;                      // w_a
  std::array<double, kMaxParameters> by{};  // the derivatives of sum_m R_m S_m
};

}  // namespace glasswing
