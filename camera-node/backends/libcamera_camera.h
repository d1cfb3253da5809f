// A camera that libcamera (0.0.3) drives, with manual exposure and gain.
//
// Frames are copied out of the driver's buffers when they are complete, and converted when their pictures are
// wanted. Settings take effect some frames late: start() waits until the frames' own metadata say that they
// have. Where a camera reports no ExposureTime (USB cameras: UVC knows none), that is taken for granted after
// a number of frames, and its exposure is what was asked, in the tenths of a millisecond that UVC has. Only
// one may be open in a process.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "camera-node/backends/pixel_format.h"
#include "camera-node/backends/sensor_time.h"
#include "camera-node/camera.h"
#include "core/frame/image_file.h"

namespace libcamera {
class Camera;
class CameraConfiguration;
class CameraManager;
}  // namespace libcamera

namespace glasswing {

class LibcameraRun;

class LibcameraCamera final : public Camera {
 public:
  struct Options {
    std::string name = "camera-1";
    std::string camera;                       // libcamera's id or model, or a part of it; empty: the only one
    std::string format;                       // libcamera's name; empty: the best that the camera has
    std::optional<PictureSize> size;          // else the camera's own choice
    std::optional<double> frame_rate_hz;      // else the camera's own
    double gain = 1.0;                        // analogue
    std::optional<double> fixed_exposure_ms;  // of a camera that has no control of it
    StampMeaning stamp = StampMeaning::kUnknown;
    std::optional<nanoseconds> readout;  // else what the camera says, or one frame
    std::optional<nanoseconds> delay;    // else one frame
  };
  // Runs the camera for some frames to learn its rate and what it reports.
  // NOT_FOUND, or INVALID_ARGUMENT for an option that it cannot fulfil: both list what there is. UNAVAILABLE:
  // another program has it, or no frames come. FAILED_PRECONDITION: it has no control of its exposure.
  static absl::StatusOr<std::unique_ptr<LibcameraCamera>> open(const Options& options);
  ~LibcameraCamera() override;

  v1::GetCameraResponse describe() const override;
  // UNAVAILABLE: the camera is gone, or gives no frames. FAILED_PRECONDITION: it does not do what it was
  // told.
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;

 private:
  explicit LibcameraCamera(const Options& options);
  absl::Status find_camera();
  absl::Status learn_format();
  absl::Status learn_controls();
  absl::Status learn_rate();
  std::unique_ptr<libcamera::CameraConfiguration> configuration(libcamera::Camera& camera) const;
  absl::Status begin(double exposure_ms);
  absl::Status wait_for_settings();
  absl::Status why_no_frames() const;

  const Options options_;
  std::unique_ptr<libcamera::CameraManager> manager_;
  std::string id_;
  bool usb_ = false;
  const PixelFormat* format_ = nullptr;
  PictureSize size_;
  double min_exposure_ms_ = 0.0, max_exposure_ms_ = 0.0;
  nanoseconds period_{};                // of a frame
  std::optional<nanoseconds> readout_;  // as the camera says
  double exposure_ms_ = 0.0;            // of this run
  std::int64_t first_sequence_ = 1;     // of this run
  std::int64_t last_sequence_ = 0;      // of all
  std::unique_ptr<LibcameraRun> run_;
};

}  // namespace glasswing
