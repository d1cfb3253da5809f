#include "core/cli/amount.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

TEST(OffsetText, HasTheUnitThatSuitsIt) {
  EXPECT_EQ(offset_text(40.2e3), "40.2 us");
  EXPECT_EQ(offset_text(999.6e3), "1 ms");
  EXPECT_EQ(offset_text(-12.5e6), "-12.5 ms");
  EXPECT_EQ(offset_text(3.21e9), "3.21 s");
  EXPECT_EQ(offset_text(59.96e9), "1 min 0 s");
  EXPECT_EQ(offset_text(312e9), "5 min 12 s");
  EXPECT_EQ(offset_text(3600e9 * 23.999), "23 h 59 min");
  EXPECT_EQ(offset_text(-86400e9 * 3.2), "-3 d 4 h");
}

}  // namespace
}  // namespace glasswing
