// A camera driven by libcamera (0.0.3), with manual exposure and gain.
//
// Frames are copied out of the driver's buffers when they are complete, and converted when their pictures are
// requested. Settings take effect some frames late: start() waits until the frames' metadata report them. If
// a camera reports no ExposureTime (USB cameras: UVC has none), start() assumes after some frames that the
// exposure is the requested one, which UVC takes in tenths of a millisecond. Only one LibcameraCamera may
// exist in a process.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "camera-node/backends/pixel_format.h"
#include "camera-node/backends/sensor_time.h"
#include "camera-node/camera.h"
#include "core/image/image_file.h"

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
    std::string camera;                   // libcamera's id or model, or a part of it; empty: the only camera
    std::string format;                   // libcamera's name; empty: the camera's best
    std::optional<PictureSize> size;      // default: the camera's choice
    std::optional<double> frame_rate_hz;  // default: the camera's own
    double gain = 1.0;                    // analogue
    std::optional<double> fixed_exposure_ms;  // for a camera without an exposure control
    StampMeaning stamp = StampMeaning::kUnknown;
    std::optional<nanoseconds> readout;  // default: as the camera reports, or one frame period
    std::optional<nanoseconds> delay;    // default: one frame period
  };
  // Runs the camera for some frames to measure its rate and learn its readout time. NOT_FOUND: not exactly
  // one camera matches. INVALID_ARGUMENT: an unsupported option. Both list what is available. UNAVAILABLE:
  // another program is using the camera, or no frames arrive. FAILED_PRECONDITION: its exposure cannot be
  // controlled.
  static absl::StatusOr<std::unique_ptr<LibcameraCamera>> open(const Options& options);
  ~LibcameraCamera() override;

  v1::GetCameraResponse describe() const override;
  // UNAVAILABLE: the camera is unplugged or delivers no frames. FAILED_PRECONDITION: it does not apply its
  // settings.
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
  std::optional<nanoseconds> readout_;  // as the camera reports
  double exposure_ms_ = 0.0;            // of this run
  std::int64_t first_sequence_ = 1;     // of this run
  std::int64_t last_sequence_ = 0;      // of all runs
  std::unique_ptr<LibcameraRun> run_;
};

}  // namespace glasswing
