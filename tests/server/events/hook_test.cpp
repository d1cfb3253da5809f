#include "server/events/hook.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class HookTest : public testing::Test {
 protected:
  HookTest() { EXPECT_EQ(::mkfifo(told_.c_str(), 0600), 0); }
  static Event event(std::string_view what, const std::string& session) {
    return {.what = what, .session = session, .text = "it \"happened\"\n", .advice = "$HOME;x"};
  }

  const TemporaryDirectory folder_;
  const std::string told_ = folder_ / "told";  // a pipe, which the command writes
};

TEST_F(HookTest, TheCommandGetsTheEventAsJson) {
  std::ifstream told;
  const auto hook = Hook::create({.command = "tee " + told_, .events = "paused,session-done"}).value();
  hook->add(event("drift", "left-out"));
  hook->add(event("paused", "vase"));
  std::string line;
  told.open(told_);  // waits for the command
  ASSERT_TRUE(std::getline(told, line));
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["event"], "paused");
  EXPECT_EQ(json["session"], "vase");
  EXPECT_EQ(json["advice"], "$HOME;x");
  EXPECT_FALSE(json["time"].get<std::string>().empty());
}

// Both runs end: the second begins only when the first was ended at its limit.
TEST_F(HookTest, ACommandThatHangsIsEnded) {
  std::fstream told(told_);  // for both directions: neither side waits for the other
  const auto hook = Hook::create({.command = "sh -c echo>" + told_ + ";exec\tsleep\t1000",
                                  .limit = std::chrono::milliseconds(500)})
                        .value();
  hook->add(event("paused", "a"));
  hook->add(event("paused", "b"));
  std::string line;
  EXPECT_TRUE(std::getline(told, line));
  EXPECT_TRUE(std::getline(told, line));
}

TEST_F(HookTest, MoreEventsThanItHoldsDoNotWait) {
  const auto hook = Hook::create({.command = "sleep 1000"}).value();
  const nanoseconds begun = monotonic_now();
  for (size_t i = 0; i < 10 * Hook::kMaxQueued; ++i) hook->add(event("paused", "vase"));
  EXPECT_LT(monotonic_now() - begun, std::chrono::seconds(30)) << "less than one run";
}

TEST_F(HookTest, EventsThatThereAreNotAreRefused) {
  const absl::Status status = Hook::create({.command = "true", .events = "paused,tea"}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_NE(std::string(status.message()).find("\"tea\""), std::string::npos) << status;
  EXPECT_NE(std::string(status.message()).find("needs-operator"), std::string::npos) << status;
}

}  // namespace
}  // namespace glasswing
