#include "client/cli/time_argument.h"

#include <gtest/gtest.h>

#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST(TimeArgument, DaysHoursDatesAndTimes) {
  const absl::Time now = absl::FromCivil(absl::CivilSecond(2026, 11, 22, 1, 2, 3), absl::UTCTimeZone());
  for (const auto& [text, time] : {std::pair("7d", "2026-11-15T01:02:03Z"),
                                   {"0d", "2026-11-22T01:02:03Z"},
                                   {"25h", "2026-11-21T00:02:03Z"},
                                   {"2026-11-01", "2026-11-01T00:00:00Z"},
                                   {"2026-11-01T12:00:00Z", "2026-11-01T12:00:00Z"},
                                   {"2026-11-01T12:00:00+01:00", "2026-11-01T11:00:00Z"}}) {
    const absl::StatusOr<std::string> got = parse_time_argument("--since", text, now);
    ASSERT_OK(got);
    EXPECT_EQ(*got, time) << text;
  }
  for (const char* text : {"", "7", "d", "7w", "-7d", "2026-13-01", "yesterday", "7d ago"}) {
    const absl::Status status = parse_time_argument("--since", text, now).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << text;
    EXPECT_NE(status.message().find("--since"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
