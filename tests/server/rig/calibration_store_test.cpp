#include "server/rig/calibration_store.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class CalibrationStoreTest : public testing::Test {
 protected:
  static v1::MonitorSync sync(const std::string& monitor, std::int64_t lag_ns) {
    v1::MonitorSync sync;
    sync.set_monitor(monitor);
    sync.set_lag_ns(lag_ns);
    sync.set_settle_ns(4'000'000);
    sync.set_error_ns(20'000);
    sync.set_measured("2026-01-31T12:00:00Z");
    return sync;
  }
  const TemporaryDirectory data_;
  Problems problems_;
};

TEST_F(CalibrationStoreTest, TheNewestOfEachMonitorSurvivesARestart) {
  {
    const auto store = CalibrationStore::open(data_, problems_);
    ASSERT_OK(store);
    EXPECT_FALSE((*store)->sync("back").has_value());
    ASSERT_OK((*store)->put(sync("back", 1)));
    ASSERT_OK((*store)->put(sync("left", 2)));
    ASSERT_OK((*store)->put(sync("back", 6'300'000)));
  }
  const auto again = CalibrationStore::open(data_, problems_);
  ASSERT_OK(again);
  ASSERT_TRUE((*again)->sync("back").has_value());
  EXPECT_EQ((*again)->sync("back")->SerializeAsString(), sync("back", 6'300'000).SerializeAsString());
  EXPECT_EQ((*again)->sync("left")->lag_ns(), 2);
  EXPECT_FALSE((*again)->sync("top").has_value());
}

TEST_F(CalibrationStoreTest, CurvesSurviveARestartUntilTheyAreForgotten) {
  v1::CameraCalibration camera;
  camera.set_camera("camera-1");
  camera.set_saturation(0.98);
  v1::DisplayCalibration display;
  display.set_monitor("back");
  display.add_black(0.01);
  {
    const auto store = CalibrationStore::open(data_, problems_).value();
    ASSERT_OK(store->put(camera));
    ASSERT_OK(store->put(display));
    camera.set_saturation(0.99);
    ASSERT_OK(store->put(camera));
    EXPECT_TRUE(absl::IsInvalidArgument(store->put(v1::CameraCalibration())));
  }
  const auto store = CalibrationStore::open(data_, problems_).value();
  EXPECT_EQ(store->camera("camera-1")->SerializeAsString(), camera.SerializeAsString());
  EXPECT_EQ(store->display("back")->SerializeAsString(), display.SerializeAsString());
  EXPECT_FALSE(store->display("left").has_value());
  ASSERT_OK(store->forget("camera-1"));
  EXPECT_TRUE(absl::IsNotFound(store->forget("camera-1")));
  EXPECT_FALSE(CalibrationStore::open(data_, problems_).value()->camera("camera-1").has_value());
  EXPECT_EQ(CalibrationStore::open(data_, problems_).value()->displays().size(), 1u);
}

TEST_F(CalibrationStoreTest, ADamagedFileIsSetAsideAndTheOthersAreUsed) {
  {
    const auto store = CalibrationStore::open(data_, problems_).value();
    ASSERT_OK(store->put(sync("back", 1)));
    for (const char* name : {"camera-1", "camera-2"}) {
      v1::CameraCalibration camera;
      camera.set_camera(name);
      ASSERT_OK(store->put(camera));
    }
  }
  EXPECT_TRUE(problems_.all().empty());
  const fs::path sync_file = data_ / "calibration/sync.json",
                 camera_file = data_ / "calibration/camera-camera-1.json";
  std::ofstream(sync_file) << "{\"monitors\": [{\"lag";
  std::ofstream(camera_file) << "{\"camera\": \"camera-3\"}";
  const auto store = CalibrationStore::open(data_, problems_);
  ASSERT_OK(store);
  EXPECT_FALSE((*store)->sync("back").has_value());
  EXPECT_EQ((*store)->cameras().size(), 1u);
  EXPECT_TRUE((*store)->camera("camera-2").has_value());
  const std::vector<std::string> said = problems_.all();
  ASSERT_EQ(said.size(), 2u);
  EXPECT_NE(said[0].find(camera_file.string()), std::string::npos) << said[0];
  EXPECT_NE(said[1].find(sync_file.string()), std::string::npos) << said[1];
  EXPECT_NE(said[1].find("glasswing calibrate sync"), std::string::npos) << said[1];
  for (const fs::path& file : {sync_file, camera_file}) {
    EXPECT_FALSE(fs::exists(file));
    EXPECT_TRUE(fs::exists(data_ / "damaged" / file.lexically_relative(data_)));
  }
  ASSERT_OK((*store)->put(sync("back", 2)));
  EXPECT_EQ(CalibrationStore::open(data_, problems_).value()->sync("back")->lag_ns(), 2);
}

}  // namespace
}  // namespace glasswing
