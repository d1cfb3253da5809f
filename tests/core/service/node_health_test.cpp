#include "core/service/node_health.h"

#include <gtest/gtest.h>

#include "core/file/file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

TEST(NodeHealth, TellsTheWarmestSensorAndTheDisk) {
  namespace fs = std::filesystem;
  const TemporaryDirectory scratch;
  fs::create_directories(scratch / "hwmon0");
  fs::create_directories(scratch / "hwmon1");
  EXPECT_FALSE(node_health({}, scratch).has_temperature_c());
  EXPECT_FALSE(node_health({}, scratch / "none").has_temperature_c());
  ASSERT_OK(write_file_durably(scratch / "hwmon0/temp1_input", "41500\n"));
  ASSERT_OK(write_file_durably(scratch / "hwmon1/temp2_input", "63000\n"));
  ASSERT_OK(write_file_durably(scratch / "hwmon1/temp3_input", ""));  // a sensor that cannot be read
  EXPECT_DOUBLE_EQ(node_health({}, scratch).temperature_c(), 63.0);
  EXPECT_EQ(node_health({}, scratch).total_bytes(), 0);
  const v1::NodeHealth stores = node_health(scratch, scratch);
  EXPECT_EQ(stores.total_bytes(), static_cast<std::int64_t>(fs::space(scratch).capacity));
  EXPECT_GT(stores.free_bytes(), 0);
}

}  // namespace
}  // namespace glasswing
