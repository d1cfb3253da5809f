// A simulated camera, free-running, that sees a scene lit by what displays really emitted; and its stage.
// What moves there stands still during an exposure, where it is in the middle of it by the camera's own
// clock.
#pragma once

#include <memory>
#include <mutex>
#include <random>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "camera-node/camera.h"
#include "core/base/node_clock.h"
#include "core/sim/automatics.h"
#include "core/sim/emission_timeline.h"
#include "core/sim/scene.h"
#include "core/sim/sensor.h"
#include "core/sim/transport.h"

namespace glasswing {

struct SimCameraOptions {
  std::string name = "camera-1";
  std::string scene = "crystal";
  int width_px = 128;
  int height_px = 96;
  double frame_rate_hz = 200.0;
  double blur_sigma_px = 0.0;  // of the lens
  SensorModel sensor;
  Automatics automatics = {};  // that it does not tell of: exposure and gain are reported as asked for
  NodeClock clock = {};        // in which it stamps
  double drop = 0.0;           // probability that a frame is lost: its number is skipped
  double duplicate = 0.0;      // probability that a frame holds the pixels of the one before
  nanoseconds late{};          // frames are delivered up to this late, in order
  nanoseconds stamp_jitter{};  // stamps are off by up to this, and say so
  nanoseconds stamp_shift{};   // stamps are off by this, and do not say so
};

class SimCamera final : public Camera, public Stage {
 public:
  // INVALID_ARGUMENT: an unknown scene. `timeline` outlives the camera and its frames.
  static absl::StatusOr<std::unique_ptr<SimCamera>> create(const SimCameraOptions& options,
                                                           const EmissionTimeline& timeline);

  v1::GetCameraResponse describe() const override;
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;
  bool move(bool present) override;  // the simulated motor is done at once

 private:
  SimCamera(const SimCameraOptions& options, const EmissionTimeline& timeline);
  // What lies on the sensor when a frame is read out.
  struct Exposed {
    std::int64_t sequence = 0;
    ExposureWindow window;
    bool object = false;
  };
  bool blurs() const { return options_.blur_sigma_px > 0.0; }
  nanoseconds end_of(const ExposureWindow& window) const;
  absl::StatusOr<Image16> expose_frame(const Exposed& exposed, double exposure_ms);
  // Mean radiance over each row's exposure, as far as the light is known by now.
  absl::StatusOr<RadianceImage> radiance_on(const Exposed& exposed);
  absl::Status apply_automatics(const Exposed& exposed, double exposure_ms, RadianceImage& radiance);
  void prepare(std::stop_token stop);
  // For the monitors that emit now; built again when they change.
  absl::StatusOr<StageTransports> stage(const std::vector<EmissionMonitor>& monitors);

  const SimCameraOptions options_;
  const EmissionTimeline& timeline_;
  const Motion motion_;
  std::mutex mutex_;
  bool object_ = false;        // guarded by mutex_
  bool running_ = false;       // guarded by mutex_
  double exposure_ms_ = 0.0;   // guarded by mutex_
  std::int64_t sequence_ = 0;  // guarded by mutex_
  nanoseconds next_start_{};   // guarded by mutex_
  Exposed newest_;             // guarded by mutex_, but for duplicates
  std::mt19937_64 random_;     // guarded by mutex_
  nanoseconds delivered_{};    // when the newest frame was; next() has one caller
  std::mutex build_mutex_;
  std::vector<SceneMonitor> built_for_;  // guarded by build_mutex_
  StageTransports stage_;                // guarded by build_mutex_
  std::jthread preparing_;  // traces the scene as soon as there are monitors: a real one is simply there
};

}  // namespace glasswing
