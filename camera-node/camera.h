// The interfaces to a camera and to the stage that holds the object.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <string>

#include "core/base/time.h"
#include "core/image/image.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// A frame that the camera has exposed. `image` makes its picture on demand: a real camera converts a held
// buffer, the simulated one integrates the light at that moment. UNAVAILABLE: the frame is lost.
struct CapturedFrame {
  v1::FrameTaken taken;  // times on CLOCK_MONOTONIC
  std::function<absl::StatusOr<Image16>()> image;
  size_t held_bytes = 0;  // size of the buffer that `image` holds
};

// tests/camera-node/backends/camera_contract.h tests what every backend guarantees. describe() and
// take_picture() and trigger() may be called from any thread at any time, the others from one thread at a
// time.
class Camera {
 public:
  virtual ~Camera() = default;
  // Has a preparation while the camera cannot deliver a frame yet: it opens its device, lets it warm up, or
  // simulates its scene. It may have to prepare again later.
  virtual v1::GetCameraResponse describe() const = 0;
  // Starts the camera. Returns when its frames have this exposure. INVALID_ARGUMENT: unsupported exposure
  // time. UNAVAILABLE: it is preparing for longer than a call may wait.
  virtual absl::Status start(double exposure_ms) = 0;
  // The same, but the camera then exposes only when it is triggered: by trigger(), or by its line. Requires
  // GetCameraResponse.trigger.
  virtual absl::Status start_triggered(double) {
    return absl::UnimplementedError("the camera has no trigger");
  }
  // Triggers an exposure at a time in CLOCK_MONOTONIC, at once if it has passed; returns when the trigger has
  // been sent. FAILED_PRECONDITION: the camera does not wait for one.
  virtual absl::Status trigger(nanoseconds) {
    return absl::FailedPreconditionError("the camera does not wait for triggers");
  }
  // The next frame; none if `timeout` passes first or the camera is stopped.
  virtual std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) = 0;
  virtual void stop() = 0;
  // Requests one picture (CameraService.TakePicture), if describe() says on_demand.
  virtual absl::Status take_picture(const std::string& /*what*/) {
    return absl::FailedPreconditionError("this camera does not take pictures on demand");
  }
};

class Stage {
 public:
  virtual ~Stage() = default;
  // Brings the object into view, or removes it. False: a person has to do it.
  virtual bool move(bool present) = 0;
};

// A stage without a motor.
class ManualStage final : public Stage {
 public:
  bool move(bool) override { return false; }
};

}  // namespace glasswing
