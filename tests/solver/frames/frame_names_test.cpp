#include "solver/frames/frame_names.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

TEST(FrameNames, JoinsNeighbours) {
  const std::vector<int> order{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  EXPECT_EQ(names_of({3}, order), "frame 3");
  EXPECT_EQ(names_of({2, 3, 4, 7}, order), "frames 2 to 4 and 7");
  EXPECT_EQ(names_of({0, 2, 4, 6, 8, 10}, order), "frames 0, 2, 4, 6 and 2 more stretches");
}

TEST(FrameNames, FollowsTime) {
  EXPECT_EQ(names_of({0, 2}, {1, 0, 2, 3}), "frames 0 to 2");
}

}  // namespace
}  // namespace glasswing
