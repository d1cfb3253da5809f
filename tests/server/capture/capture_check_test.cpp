// Where monitors stand, from the rig's description to a session and back.
#include "server/capture/capture_check.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "tests/support/status.h"

namespace glasswing {
namespace {

using Positions = google::protobuf::Map<std::string, double>;

Positions placed(const std::map<std::string, double>& positions) {
  return {positions.begin(), positions.end()};
}

v1::Monitor monitor(const std::string& name, std::optional<double> rail_mm = {}) {
  v1::Monitor made;
  made.set_name(name);
  if (rail_mm) made.set_rail_mm(*rail_mm);
  return made;
}

google::protobuf::RepeatedPtrField<v1::Monitor> rig() {
  google::protobuf::RepeatedPtrField<v1::Monitor> monitors;
  *monitors.Add() = monitor("back", 200.0);
  *monitors.Add() = monitor("left");
  return monitors;
}

TEST(CapturePositions, AreThoseOfRailsAndOfTheOperator) {
  EXPECT_EQ(positions_of(rig(), {})->size(), 1u);
  const Positions positions = positions_of(rig(), placed({{"left", 312.5}, {"back", 200.0}})).value();
  EXPECT_EQ(positions.size(), 2u);
  EXPECT_EQ(positions.at("back"), 200.0);
  EXPECT_EQ(positions.at("left"), 312.5);
}

TEST(CapturePositions, NobodyContradictsARail) {
  const auto refused = [](const Positions& positions, const std::string& words) {
    const absl::Status status = positions_of(rig(), positions).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused(placed({{"back", 251.2}}), "its rail reports that it is at 200");
  refused(placed({{"side", 1.0}}), "there is no monitor \"side\"");
  refused(placed({{"left", std::numeric_limits<double>::infinity()}}), "it must be a number of mm");
}

TEST(CapturePositions, ASessionGoesOnOnlyWhereItWasBegun) {
  v1::Session session;
  session.set_name("vase");
  (*session.mutable_rail_mm())["back"] = 200.0;
  (*session.mutable_rail_mm())["left"] = 312.5;
  std::vector<v1::Monitor> monitors{monitor("back", 200.0), monitor("left"), monitor("top", 7.0)};
  ASSERT_OK(enter_positions(session, monitors));
  EXPECT_EQ(monitors[1].rail_mm(), 312.5) << "as the operator said";
  EXPECT_EQ(monitors[2].rail_mm(), 7.0);
  monitors[0].set_rail_mm(251.2);
  const absl::Status moved = enter_positions(session, monitors);
  EXPECT_TRUE(absl::IsFailedPrecondition(moved)) << moved;
  EXPECT_NE(std::string(moved.message()).find("glasswing rail back:200; then: glasswing retry vase"),
            std::string::npos)
      << moved;
}

}  // namespace
}  // namespace glasswing
