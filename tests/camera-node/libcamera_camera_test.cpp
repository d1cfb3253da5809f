// Needs a camera that libcamera sees; GLASSWING_TEST_CAMERA names one that must be there.
#include "camera-node/libcamera_camera.h"

#include <cstdlib>

#include "tests/camera-node/camera_contract.h"

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

}  // namespace
}  // namespace glasswing
