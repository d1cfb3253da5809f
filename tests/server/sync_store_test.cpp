#include "server/sync_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class SyncStoreTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove_all(data_); }
  static v1::MonitorSync sync(const std::string& monitor, std::int64_t lag_ns) {
    v1::MonitorSync sync;
    sync.set_monitor(monitor);
    sync.set_lag_ns(lag_ns);
    sync.set_settle_ns(4'000'000);
    sync.set_error_ns(20'000);
    sync.set_measured("2026-01-31T12:00:00Z");
    return sync;
  }
  const fs::path data_ = fs::path(testing::TempDir()) / ("sync_store." + std::to_string(::getpid()));
};

TEST_F(SyncStoreTest, TheNewestOfEachMonitorSurvivesARestart) {
  {
    const auto store = SyncStore::open(data_);
    ASSERT_TRUE(store.ok()) << store.status();
    EXPECT_FALSE((*store)->find("back").has_value());
    ASSERT_TRUE((*store)->put(sync("back", 1)).ok());
    ASSERT_TRUE((*store)->put(sync("left", 2)).ok());
    ASSERT_TRUE((*store)->put(sync("back", 6'300'000)).ok());
  }
  const auto again = SyncStore::open(data_);
  ASSERT_TRUE(again.ok()) << again.status();
  ASSERT_TRUE((*again)->find("back").has_value());
  EXPECT_EQ((*again)->find("back")->SerializeAsString(), sync("back", 6'300'000).SerializeAsString());
  EXPECT_EQ((*again)->find("left")->lag_ns(), 2);
  EXPECT_FALSE((*again)->find("top").has_value());
}

TEST_F(SyncStoreTest, ADamagedFileIsNamed) {
  fs::create_directories(data_ / "calibration");
  std::ofstream(data_ / "calibration" / "sync.json") << "{\"monitors\": [{\"lag";
  const auto store = SyncStore::open(data_);
  EXPECT_TRUE(absl::IsDataLoss(store.status()));
  EXPECT_NE(store.status().message().find("sync.json"), std::string::npos) << store.status();
}

}  // namespace
}  // namespace glasswing
