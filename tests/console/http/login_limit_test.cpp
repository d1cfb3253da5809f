#include "console/http/login_limit.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::seconds;

class LoginLimitTest : public testing::Test {
 protected:
  void refuse(const std::string& address, int times) {
    for (int i = 0; i < times; ++i) limit_.note_refused(address, now_);
  }

  LoginLimit limit_;
  LoginLimit::Time now_{seconds(1000)};
};

TEST_F(LoginLimitTest, AnAddressThatIsRefusedTooOftenWaits) {
  refuse("10.0.0.1", LoginLimit::kMaxRefused - 1);
  EXPECT_TRUE(limit_.allows("10.0.0.1", now_));
  refuse("10.0.0.1", 1);
  EXPECT_FALSE(limit_.allows("10.0.0.1", now_));
  EXPECT_TRUE(limit_.allows("10.0.0.2", now_)) << "others do not";
  now_ += LoginLimit::kWindow - seconds(1);
  EXPECT_FALSE(limit_.allows("10.0.0.1", now_));
  now_ += seconds(1);
  EXPECT_TRUE(limit_.allows("10.0.0.1", now_));
}

TEST_F(LoginLimitTest, RemembersALimitedNumberOfAddresses) {
  refuse("first", LoginLimit::kMaxRefused);
  now_ += seconds(1);
  for (size_t i = 1; i < LoginLimit::kMaxAddresses; ++i)
    refuse(fmt::format("{}", i), LoginLimit::kMaxRefused);
  EXPECT_FALSE(limit_.allows("first", now_));
  refuse("one more", LoginLimit::kMaxRefused);
  EXPECT_TRUE(limit_.allows("first", now_)) << "the first is forgotten";
  EXPECT_FALSE(limit_.allows("one more", now_));
  EXPECT_FALSE(limit_.allows("7", now_));
}

}  // namespace
}  // namespace glasswing
