#include "client/capture/stage_axes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/status.h"

namespace glasswing {
namespace {

using Positions = std::vector<double>;

v1::Axis axis(const std::string& name, const std::string& unit, double min, double max) {
  v1::Axis axis;
  axis.set_name(name);
  axis.set_unit(unit);
  axis.set_min(min);
  axis.set_max(max);
  return axis;
}

TEST(Poses, AreARangeOrAList) {
  EXPECT_EQ(parse_poses("--turn", "0:40:20")->positions, (Positions{0.0, 20.0, 40.0}));
  EXPECT_EQ(parse_poses("--turn", "0:39:20")->positions, (Positions{0.0, 20.0}));
  EXPECT_EQ(parse_poses("--turn", "40:0:-20")->positions, (Positions{40.0, 20.0, 0.0}));
  EXPECT_EQ(parse_poses("--turn", "0:350:10")->positions.size(), 36u);
  // A tenth is no sum of powers of two.
  EXPECT_EQ(parse_poses("--turn", "0:1:0.1")->positions.size(), 11u);
  EXPECT_NEAR(parse_poses("--turn", "0:1:0.1")->positions.back(), 1.0, 1e-12);
  EXPECT_EQ(parse_poses("--turn", "turn=0,90,12.5")->positions, (Positions{0.0, 90.0, 12.5}));
  EXPECT_EQ(parse_poses("--turn", "turn=0,90,12.5")->axis, "turn");
  EXPECT_EQ(parse_poses("--turn", "7")->positions, Positions{7.0});
  for (const char* text : {"", "turn=", "0:90", "0:90:", "0:90:0", "0:90:-10", "0,", "0,,1", "0 90", "nan",
                           "0:inf:1", "0:360:0.1", "0:90:1e-9", "0:90:10deg"})
    EXPECT_TRUE(absl::IsInvalidArgument(parse_poses("--turn", text).status())) << text;
}

TEST(Poses, StandInTheAxisRangeAndOnce) {
  const v1::Axis turn = axis("turn", "deg", -180.0, 720.0), lift = axis("lift", "mm", 0.0, 720.0);
  const auto check = [](const std::string& text, const v1::Axis& on) {
    return check_poses("--turn", *parse_poses("--turn", text), on);
  };
  EXPECT_OK(check("0:350:10", turn));
  EXPECT_OK(check("0:720:360", lift));
  for (const char* text : {"0:360:10", "-10,350", "0,0", "-180,180", "-0.00001,0"})
    EXPECT_TRUE(absl::IsInvalidArgument(check(text, turn))) << text;
  EXPECT_OK(check("0:730:100", lift));
  EXPECT_TRUE(absl::IsInvalidArgument(check("0,721", lift)));
  EXPECT_TRUE(absl::IsInvalidArgument(check("-1", lift)));
}

TEST(Poses, NameSessionsThatSort) {
  EXPECT_EQ(names_of_poses("vase", {0.0, 10.0, 350.0}),
            (std::vector<std::string>{"vase-000", "vase-010", "vase-350"}));
  EXPECT_EQ(names_of_poses("v", {0.0, 2.5, 10.0}), (std::vector<std::string>{"v-00.0", "v-02.5", "v-10.0"}));
  EXPECT_EQ(names_of_poses("v", {-10.0, 0.0}), (std::vector<std::string>{"v--10", "v-000"}));
  EXPECT_EQ(names_of_poses("v", {0.0001}), std::vector<std::string>{"v-0.0001"});
  const std::vector<std::string> names = names_of_poses("v", parse_poses("--turn", "0:359.5:0.5")->positions);
  EXPECT_EQ(names.size(), 720u);
  EXPECT_TRUE(std::ranges::is_sorted(names));
  EXPECT_EQ(std::ranges::adjacent_find(names), names.end());
}

TEST(Axes, TheOneThatCanBeMeant) {
  const v1::Axis turn = axis("turn", "deg", 0.0, 360.0), lift = axis("lift", "mm", 0.0, 50.0);
  EXPECT_EQ(find_axis("", {lift}, "deg")->name(), "lift") << "the only one";
  EXPECT_EQ(find_axis("", {lift, turn}, "deg")->name(), "turn");
  EXPECT_EQ(find_axis("lift", {lift, turn}, "deg")->name(), "lift");
  EXPECT_TRUE(absl::IsFailedPrecondition(find_axis("", {lift, turn}).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(find_axis("turn", {}).status()));
  EXPECT_TRUE(absl::IsNotFound(find_axis("tilt", {lift, turn}).status()));
}

}  // namespace
}  // namespace glasswing
