#include "core/security/call_shares.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::seconds;
constexpr Roles kViewer = only(Role::kViewer), kOperator = only(Role::kOperator),
                kCamera = only(Role::kCamera);
constexpr int kMaxCalls = 64;

class CallSharesTest : public testing::Test {
 protected:
  // How many of `calls` begin.
  int begun(const std::string& caller, Roles roles, int calls) {
    int count = 0;
    for (int i = 0; i < calls; ++i) {
      const absl::Status admitted = shares_.admit(caller, roles, now_);
      EXPECT_TRUE(admitted.ok() || absl::IsResourceExhausted(admitted)) << admitted;
      if (!admitted.ok()) continue;
      shares_.begin(caller, roles);
      ++count;
    }
    return count;
  }

  CallShares::Time now_{seconds(1000)};
  CallShares shares_{kMaxCalls};
};

TEST_F(CallSharesTest, OneCallerHasAShareByItsRole) {
  EXPECT_EQ(begun("guest", kViewer, 1000), kMaxCalls / 16);
  EXPECT_EQ(begun("nobody", 0, 1000), kMaxCalls / 16);
  EXPECT_EQ(begun("me", kOperator, 1000), kMaxCalls / 8);
  EXPECT_EQ(begun("me too", kOperator | kViewer, 1000), kMaxCalls / 8);
  EXPECT_EQ(begun("console", only(Role::kConsole), 1000), kMaxCalls / 8);
  EXPECT_EQ(begun("rig", kCamera | kViewer, 1000), kMaxCalls / 2);
  shares_.end("guest");
  EXPECT_EQ(begun("guest", kViewer, 1000), 1);
}

TEST_F(CallSharesTest, ManyViewersLeaveRoomForOperatorsAndAllPeopleForPrograms) {
  int viewers = 0, operators = 0;
  for (int i = 0; i < 100; ++i) viewers += begun(fmt::format("viewer-{}", i), kViewer, 100);
  EXPECT_EQ(viewers, kMaxCalls / 4);
  for (int i = 0; i < 100; ++i) operators += begun(fmt::format("operator-{}", i), kOperator, 100);
  EXPECT_EQ(operators, kMaxCalls / 4);
  EXPECT_EQ(begun("rig", kCamera, 100), kMaxCalls / 2);
}

// The gate admits a burst before the first call of it begins.
TEST_F(CallSharesTest, CallsThatAreAdmittedCountBeforeTheyBegin) {
  int admitted = 0;
  for (int i = 0; i < 1000; ++i) admitted += shares_.admit("guest", kViewer, now_).ok();
  EXPECT_EQ(admitted, kMaxCalls / 16);
  now_ += CallShares::kBegins - seconds(1);
  EXPECT_FALSE(shares_.admit("guest", kViewer, now_).ok());
  now_ += seconds(1);  // they were cancelled before they began
  EXPECT_EQ(begun("guest", kViewer, 1000), kMaxCalls / 16);
}

}  // namespace
}  // namespace glasswing
