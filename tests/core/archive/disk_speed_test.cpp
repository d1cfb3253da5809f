#include "core/archive/disk_speed.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

TEST(DiskSpeed, IsMeasuredWithoutLeavingAFile) {
  const TemporaryDirectory directory;
  const absl::StatusOr<std::int64_t> speed = measured_write_speed(directory);
  ASSERT_OK(speed);
  EXPECT_GT(*speed, 0);
  EXPECT_TRUE(fs::is_empty(directory));
  const absl::Status missing = measured_write_speed(directory / "nowhere").status();
  EXPECT_NE(missing.message().find(directory.string()), std::string::npos) << missing;
}

TEST(DiskSpeed, IsMeasuredAnewOnceItIsOld) {
  int measured = 0;
  nanoseconds now{};
  DiskSpeed speed(
      "/data", [&](const fs::path&) -> absl::StatusOr<std::int64_t> { return 1000 + ++measured; },
      [&] { return now; });
  EXPECT_EQ(*speed.write_bytes_per_second(), 1001);
  now += DiskSpeed::kMaxAge;
  EXPECT_EQ(*speed.write_bytes_per_second(), 1001);
  now += nanoseconds(1);
  EXPECT_EQ(*speed.write_bytes_per_second(), 1002);
}

TEST(DiskSpeed, AFailedMeasurementIsTriedAgain) {
  int calls = 0;
  DiskSpeed speed("/data", [&](const fs::path&) -> absl::StatusOr<std::int64_t> {
    if (++calls == 1) return absl::ResourceExhaustedError("full");
    return 7;
  });
  EXPECT_TRUE(absl::IsResourceExhausted(speed.write_bytes_per_second().status()));
  EXPECT_EQ(*speed.write_bytes_per_second(), 7);
}

}  // namespace
}  // namespace glasswing
