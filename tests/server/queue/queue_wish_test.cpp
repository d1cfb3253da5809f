#include "server/queue/queue_wish.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::QueueWish good_wish() {
  v1::QueueWish wish;
  wish.set_session("vase-{item}");
  wish.mutable_plan()->set_method("alpha");
  for (const double value : {0.2, 0.8}) {
    v1::Solid& solid = *wish.mutable_plan()->add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(value);
  }
  return wish;
}

TEST(QueueWish, NamesSessionsByTheirPattern) {
  const absl::Time start = absl::FromCivil(absl::CivilSecond(2026, 11, 1, 20, 3, 9), absl::UTCTimeZone());
  EXPECT_EQ(session_name("vase-{item}-{date}-{time}-{item}", 7, start).value(), "vase-7-20261101-200309-7");
  EXPECT_EQ(session_name("", 7, start).value(), "");
  for (const char* pattern : {"{Item}", "{item", "vase}", "{date:%Y}", "a b", "../{item}"})
    EXPECT_TRUE(absl::IsInvalidArgument(session_name(pattern, 7, start).status())) << pattern;
}

TEST(QueueWish, GivesACopyANameOfItsOwn) {
  v1::QueueWish wish = good_wish();
  EXPECT_EQ(copied_wish(wish).session(), "vase-{item}");
  wish.set_session("vase");
  EXPECT_EQ(copied_wish(wish).session(), "vase-{item}");
  wish.clear_session();
  EXPECT_EQ(copied_wish(wish).session(), "");
}

TEST(QueueWish, NamesItsImages) {
  v1::QueueWish wish = good_wish();
  EXPECT_TRUE(images_of(wish).empty());
  wish.mutable_plan()->add_photos()->set_file("a");
  wish.mutable_plan()->add_photos()->set_file("b");
  (*wish.mutable_background())["back"] = "b";
  (*wish.mutable_background())["left"] = "c";
  EXPECT_EQ(images_of(wish), (std::set<std::string>{"a", "b", "c"}));
}

TEST(QueueWish, RefusesWhatCouldNeverRun) {
  EXPECT_OK(check_wish(good_wish()));
  const auto refused = [](const std::string& word, const auto& spoil) {
    v1::QueueWish wish = good_wish();
    spoil(wish);
    const absl::Status status = check_wish(wish);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << word;
    EXPECT_NE(std::string(status.message()).find(word), std::string::npos) << status;
  };
  refused("braces", [](v1::QueueWish& wish) { wish.set_session("{object}"); });
  refused("session", [](v1::QueueWish& wish) { wish.set_session(std::string(60, 'x') + "{item}"); });
  refused("method", [](v1::QueueWish& wish) { wish.mutable_plan()->set_method("magic"); });
  refused("ask for the solve", [](v1::QueueWish& wish) { (*wish.mutable_background())["back"] = "a"; });
  refused("monitor", [](v1::QueueWish& wish) {
    wish.set_solve(true);
    (*wish.mutable_background())["back=/etc/passwd"] = "a";
  });
  refused("tag", [](v1::QueueWish& wish) { wish.add_tags("two words"); });
  refused("retries", [](v1::QueueWish& wish) { wish.set_retries(101); });
  refused("retry_wait_s", [](v1::QueueWish& wish) { wish.set_retry_wait_s(-1.0); });
  refused("give_up_s",
          [](v1::QueueWish& wish) { wish.set_give_up_s(std::numeric_limits<double>::quiet_NaN()); });
  refused("not_before", [](v1::QueueWish& wish) { wish.set_not_before("tomorrow"); });
  refused("rail_mm", [](v1::QueueWish& wish) {
    (*wish.mutable_rail_mm())["back"] = std::numeric_limits<double>::infinity();
  });
}

}  // namespace
}  // namespace glasswing
