#include "server/rig/embed_calibrations.h"

#include <gtest/gtest.h>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class EmbedCalibrations : public testing::Test {
 protected:
  void SetUp() override {
    store_ = CalibrationStore::open(data_, problems_).value();
    v1::CameraCalibration camera;
    camera.set_camera("camera-1");
    camera.set_width_px(64);
    camera.set_height_px(48);
    camera.set_bits(10);
    ASSERT_OK(store_->put(camera));
    v1::DisplayCalibration display;
    display.set_monitor("back");
    display.set_width_px(128);
    display.set_height_px(96);
    display.set_bits(8);
    ASSERT_OK(store_->put(display));

    header_.mutable_camera()->set_name("camera-1");
    header_.mutable_camera()->set_width_px(64);
    header_.mutable_camera()->set_height_px(48);
    header_.mutable_camera()->set_bits(10);
    header_.mutable_camera()->set_response("unknown");
    for (const char* name : {"back", "left"}) {
      v1::Monitor& monitor = *header_.add_monitors();
      monitor.set_name(name);
      monitor.set_width_px(128);
      monitor.set_height_px(96);
      monitor.set_bits(8);
    }
    header_.mutable_plan()->set_method("gaussian");
  }

  const TemporaryDirectory data_;
  Problems problems_;
  std::unique_ptr<CalibrationStore> store_;
  v1::CaptureManifest header_;
};

TEST_F(EmbedCalibrations, ASessionGetsWhatIsKnownOfItsDevices) {
  EXPECT_NE(uncalibrated_warning(header_).find("calibrate camera"), std::string::npos);
  ASSERT_OK(embed_calibrations(*store_, header_));
  EXPECT_EQ(header_.camera_calibration().camera(), "camera-1");
  ASSERT_EQ(header_.display_calibrations_size(), 1);
  EXPECT_EQ(header_.display_calibrations(0).monitor(), "back");
  EXPECT_EQ(uncalibrated_warning(header_), "");
}

TEST_F(EmbedCalibrations, AMeasurementDoesWithoutWhatItMeasures) {
  header_.mutable_plan()->mutable_calibration()->set_of("display");
  v1::CaptureManifest display = header_;
  ASSERT_OK(embed_calibrations(*store_, display));
  EXPECT_TRUE(display.has_camera_calibration());
  EXPECT_EQ(display.display_calibrations_size(), 0);
  header_.mutable_plan()->mutable_calibration()->set_of("camera");
  ASSERT_OK(embed_calibrations(*store_, header_));
  EXPECT_FALSE(header_.has_camera_calibration());
  EXPECT_EQ(uncalibrated_warning(header_), "");
}

TEST_F(EmbedCalibrations, ADeviceThatIsNotAsItWasIsRefusedByName) {
  v1::CaptureManifest other = header_;
  other.mutable_camera()->set_width_px(65);
  absl::Status status = embed_calibrations(*store_, other);
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_NE(status.message().find("65 x 48"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("calibrate forget camera-1"), std::string_view::npos) << status;
  header_.mutable_monitors(0)->set_bits(10);
  status = embed_calibrations(*store_, header_);
  EXPECT_NE(status.message().find("\"back\""), std::string_view::npos) << status;
}

}  // namespace
}  // namespace glasswing
