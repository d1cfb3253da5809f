// Skipped unless libcamera sees a camera. GLASSWING_TEST_CAMERA names one that must be present;
// GLASSWING_TEST_UNPLUG and GLASSWING_TEST_PLUG_IN are commands that unplug it and plug it in.
#include "camera-node/backends/libcamera_camera.h"

#include <cstdlib>

#include "tests/camera-node/backends/camera_contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

std::unique_ptr<Camera> make_libcamera() {
  LibcameraCamera::Options options;
  const char* const named = std::getenv("GLASSWING_TEST_CAMERA");
  if (named != nullptr) options.camera = named;
  absl::StatusOr<std::unique_ptr<LibcameraCamera>> camera = LibcameraCamera::open(options);
  if (absl::IsFailedPrecondition(camera.status())) {  // its exposure cannot be set
    options.fixed_exposure_ms = 5.0;
    camera = LibcameraCamera::open(options);
  }
  const bool none = absl::IsNotFound(camera.status()) &&
                    camera.status().message().find("libcamera sees none") != absl::string_view::npos;
  if (none && named == nullptr) return nullptr;
  return std::move(camera).value();
}

INSTANTIATE_TEST_SUITE_P(Libcamera, CameraContract, testing::Values(make_libcamera));

TEST(LibcameraCamera, SaysWhatItSees) {
  LibcameraCamera::Options options;
  options.camera = "no such camera";
  const absl::Status unknown = LibcameraCamera::open(options).status();
  EXPECT_TRUE(absl::IsNotFound(unknown)) << unknown;
  for (const std::string words : {"no such camera", "libcamera sees"})
    EXPECT_NE(std::string(unknown.message()).find(words), std::string::npos) << unknown;
}

TEST(LibcameraCamera, IsMissedWhenUnpluggedAndUsedWhenPluggedInAgain) {
  const char* const unplug = std::getenv("GLASSWING_TEST_UNPLUG");
  const char* const plug_in = std::getenv("GLASSWING_TEST_PLUG_IN");
  if (unplug == nullptr || plug_in == nullptr)
    GTEST_SKIP() << "no commands to unplug the camera and plug it in";
  const std::unique_ptr<Camera> camera = make_libcamera();
  const double exposure_ms = camera->describe().min_exposure_ms();
  const auto start_when_there = [&] {
    const nanoseconds begun = monotonic_now();
    absl::Status status;
    do {
      status = camera->start(exposure_ms);
    } while (absl::IsUnavailable(status) && monotonic_now() - begun < std::chrono::seconds(60));
    return status;
  };
  std::int64_t last_sequence = 0;
  for (int round = 0; round < 2; ++round) {
    const absl::Status started = start_when_there();
    ASSERT_OK(started);
    for (int i = 0; i < 5; ++i) {
      const std::optional<CapturedFrame> frame = camera->next(std::chrono::seconds(10));
      ASSERT_TRUE(frame);
      EXPECT_GT(frame->taken.sequence(), last_sequence);
      last_sequence = frame->taken.sequence();
    }
    ASSERT_EQ(std::system(unplug), 0);
    int after = 0;  // frames in flight
    while (camera->next(std::chrono::seconds(2))) ASSERT_LT(++after, 100);
    const absl::Status gone = camera->start(exposure_ms);
    EXPECT_TRUE(absl::IsUnavailable(gone)) << gone;
    EXPECT_NE(std::string(gone.message()).find("is gone"), std::string::npos) << gone;
    EXPECT_FALSE(camera->next(std::chrono::milliseconds(0)));
    ASSERT_EQ(std::system(plug_in), 0);
  }
  EXPECT_OK(start_when_there());
}

}  // namespace
}  // namespace glasswing
