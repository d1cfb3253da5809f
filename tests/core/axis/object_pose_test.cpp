#include "core/axis/object_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/rig_geometry.h"
#include "core/sim/turntable.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

// On the simulator's table, which has an upright axis.
TEST(ObjectPose, IsThatOfTheSimulatedTable) {
  v1::AxisGeometry axis;
  for (const double number : {0.0, 1.0, 0.0}) axis.add_direction(number);
  for (const double number : {1.0, 2.0, 200.0}) axis.add_point_mm(number);
  for (const double position_deg : {0.0, 30.0, 200.0, -75.0}) {
    const Rotation rotation = rotation_of({.turn_deg = position_deg});
    const Vec3 there = rotation(Vec3{4.0, -7.0, 11.0});
    const Eigen::Vector4d found = object_to_rig(axis, position_deg) * Eigen::Vector4d(4.0, -7.0, 11.0, 1.0);
    EXPECT_NEAR(found.x(), there.x + 1.0, 1e-12);
    EXPECT_NEAR(found.y(), there.y + 2.0, 1e-12);
    EXPECT_NEAR(found.z(), there.z + 200.0, 1e-12);
    EXPECT_EQ(found.w(), 1.0);
  }
}

constexpr const char* kGeometry =
    "camera { width_px: 16 height_px: 12 fx_px: 25 fy_px: 25 cx_px: 8 cy_px: 6 }\n"
    "monitors { name: \"near\" width_px: 128 height_px: 96 pitch_mm: 1 rotation: [1, 0, 0, 0, 1, 0, 0, 0, "
    "1]\n"
    "  translation_mm: [-64, -48, 200] }\n";

TEST(ObjectPose, NamesTheAxesOfAGeometry) {
  const v1::RigGeometry none = *parse_geometry(kGeometry, "rig.txtpb");
  EXPECT_THAT(std::string(find_axis_geometry(none, "turn").status().message()),
              HasSubstr("no axis \"turn\"; glasswing calibrate axis measures it"));
  const absl::StatusOr<v1::RigGeometry> one = parse_geometry(
      std::string(kGeometry) + "axes { name: \"turn\" direction: [0, 1, 0] point_mm: [0, 0, 200] }",
      "rig.txtpb");
  ASSERT_OK(one);
  ASSERT_OK(find_axis_geometry(*one, "turn"));
  EXPECT_THAT(std::string(find_axis_geometry(*one, "lift").status().message()), HasSubstr("only turn"));
}

TEST(ObjectPose, BadAxesOfAGeometryAreNamed) {
  const auto error = [](const std::string& axis) {
    return std::string(parse_geometry(kGeometry + ("axes { " + axis + " }"), "rig.txtpb").status().message());
  };
  EXPECT_THAT(error("direction: [0, 1, 0] point_mm: [0, 0, 0]"), HasSubstr("an axis has no name"));
  EXPECT_THAT(error("name: \"turn\" direction: [0, 1] point_mm: [0, 0, 0]"),
              HasSubstr("axis \"turn\" has 2 numbers of direction and 3 of point_mm; they must be 3 and 3"));
  EXPECT_THAT(error("name: \"turn\" direction: [0, 1, 1] point_mm: [0, 0, 0]"), HasSubstr("it must be 1"));
  EXPECT_THAT(error("name: \"turn\" direction: [0, 1, 0] point_mm: [0, 0, nan]"), HasSubstr("point_mm"));
  EXPECT_THAT(error("name: \"turn\" direction: [0, 1, 0] point_mm: [0, 0, 0] covariance: [1]"),
              HasSubstr("they must be 36, or none"));
}

}  // namespace
}  // namespace glasswing
