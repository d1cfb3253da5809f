#include "server/rig/node_registry.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

class RigTest : public testing::Test {
 protected:
  void hear(v1::NodeKind kind, const std::string& name) {
    v1::RegisterRequest request;
    request.set_kind(kind);
    request.set_name(name);
    if (kind == v1::NODE_KIND_SOLVER) request.mutable_solver()->set_host("host of " + name);
    EXPECT_TRUE(rig_.add(request).ok());
  }

  nanoseconds now_ = seconds(1000);
  NodeRegistry rig_{[this] { return now_; }};
};

TEST_F(RigTest, ASilentNodeIsAway) {
  hear(v1::NODE_KIND_DISPLAY, "display-1");
  now_ += seconds(4);
  EXPECT_TRUE(rig_.nodes().front().up());
  now_ += seconds(1);
  EXPECT_FALSE(rig_.nodes().front().up());
}

TEST_F(RigTest, AClockIsToldWithItsAgeUntilItsNodeIsAway) {
  hear(v1::NODE_KIND_CAMERA, "camera-1");
  EXPECT_FALSE(rig_.nodes().front().has_clock());
  rig_.note_clock("camera-1", std::chrono::milliseconds(-3), std::chrono::microseconds(40));
  rig_.note_clock("nobody", seconds(1), seconds(1));
  now_ += seconds(2);
  EXPECT_EQ(rig_.nodes().front().clock().offset_ns(), -3'000'000);
  EXPECT_EQ(rig_.nodes().front().clock().bound_ns(), 40'000);
  EXPECT_DOUBLE_EQ(rig_.nodes().front().clock().age_s(), 2.0);
  now_ += seconds(3);
  EXPECT_FALSE(rig_.nodes().front().has_clock());
}

TEST_F(RigTest, SolversAreKnownWithWhatTheySaidAndForgottenWhenTheyHaveLeft) {
  hear(v1::NODE_KIND_CAMERA, "camera-1");
  hear(v1::NODE_KIND_SOLVER, "b");
  hear(v1::NODE_KIND_SOLVER, "a");
  ASSERT_EQ(rig_.solvers().size(), 2u);
  EXPECT_EQ(rig_.solvers().front().node.name(), "a");
  EXPECT_EQ(rig_.solvers().front().info.host(), "host of a");
  now_ += kForgotten / 2;
  hear(v1::NODE_KIND_SOLVER, "b");
  now_ += kForgotten / 2;
  ASSERT_EQ(rig_.solvers().size(), 1u);
  EXPECT_EQ(rig_.solvers().front().node.name(), "b");
  EXPECT_FALSE(rig_.solvers().front().node.up());
  // Displays and cameras are never forgotten.
  ASSERT_EQ(rig_.nodes().size(), 2u);
  EXPECT_EQ(rig_.nodes().front().name(), "camera-1");
}

}  // namespace
}  // namespace glasswing
