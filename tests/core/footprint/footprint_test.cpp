#include "core/footprint/footprint.h"

#include <gtest/gtest.h>

#include "core/matte/matte_file.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// A fit that ends on the boundary of the positive Sigma can end a rounding error beyond it.
TEST(Footprint, WhatRoundingTookFromAWidthOfZeroDoesNotMakeAMatteBad) {
  Footprint line{.weight = 0.5, .x_px = 3.0, .y_px = 4.0};
  line.xx_px2 = -1.3877787807814457e-17;
  line.yy_px2 = 2.0;
  Matte matte(0, 0, 1, 1, 1);
  matte.metadata.add_monitors();
  matte.modes(0, 0, 0)[0] = mode_of(line, 0.01, 0.1, 0);
  EXPECT_OK(check_matte(matte));
  line.xx_px2 = 2.0;
  line.yy_px2 = -1.3877787807814457e-17;
  matte.modes(0, 0, 0)[0] = mode_of(line, 0.01, 0.1, 0);
  EXPECT_OK(check_matte(matte));
}

}  // namespace
}  // namespace glasswing
