// The seam to a camera.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <string>

#include "core/base/time.h"
#include "core/frame/image.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// A frame that the camera has exposed. Its picture is fetched only when it is wanted: a real camera holds a
// buffer, the simulated one integrates the light then.
struct CapturedFrame {
  v1::FrameTaken taken;  // times on CLOCK_MONOTONIC
  std::function<absl::StatusOr<Image16>()> image;
  size_t held_bytes = 0;  // of memory, by the buffer
};

// What every backend keeps: tests/camera-node/backends/camera_contract.h. describe() may be called at any
// time, the others by one thread at a time.
class Camera {
 public:
  virtual ~Camera() = default;
  virtual v1::GetCameraResponse describe() const = 0;
  // Runs the camera. Returns when frames have these settings. INVALID_ARGUMENT: it cannot expose so.
  virtual absl::Status start(double exposure_ms) = 0;
  // The next frame; none if it takes longer than `timeout` or the camera is stopped.
  virtual std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) = 0;
  virtual void stop() = 0;
};

// The seam to the stage that holds the object.
class Stage {
 public:
  virtual ~Stage() = default;
  // True: the object is (not) in view now. False: a person has to move it.
  virtual bool move(bool present) = 0;
};

// A stage without a motor.
class ManualStage final : public Stage {
 public:
  bool move(bool) override { return false; }
};

}  // namespace glasswing
