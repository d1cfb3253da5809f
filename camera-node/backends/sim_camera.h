// A free-running simulated camera, which sees a scene lit by what the displays emitted, and its stage. A
// moving object is frozen during each exposure, at its position in the middle of it by the camera's own
// clock. The camera prepares while it traces the scene for the monitors' current places, which takes minutes
// for megapixels.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "camera-node/camera.h"
#include "core/base/node_clock.h"
#include "core/sim/automatics.h"
#include "core/sim/disturbances.h"
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
  double blur_sigma_px = 0.0;  // lens blur
  bool ray_areas = false;      // build_phases()
  // Focal length of the lens, px of the picture along x; at least its width. Empty: kFocalWidths widths.
  std::optional<double> focal_px = {};
  bool awaits_light = false;  // it prepares until a monitor is known; else it is dark until then
  std::string mosaic;         // as v1::Camera.mosaic; empty: pixels have all colours
  SensorModel sensor;
  Disturbances disturbances = {};
  Automatics automatics = {};  // not reported: exposure and gain are reported as requested
  double wobble_deg = 0.0;     // of the object's table (Turntable)
  double backlash_deg = 0.0;   // of the table's gear: coming from above, it stands so much further up
  NodeClock clock = {};        // of the time stamps
  double drop = 0.0;           // probability that a frame is lost; its sequence number is skipped
  double duplicate = 0.0;      // probability that a frame holds the pixels of the one before
  nanoseconds late{};          // max delivery delay; frames stay in order
  nanoseconds stamp_jitter{};  // max error of stamps, included in their uncertainty
  nanoseconds stamp_shift{};   // constant error of stamps, not in their uncertainty
};

class SimCamera final : public Camera, public Stage {
 public:
  // INVALID_ARGUMENT: an unknown scene, or a focal length that is too short. `timeline` outlives the camera
  // and its frames.
  static absl::StatusOr<std::unique_ptr<SimCamera>> create(const SimCameraOptions& options,
                                                           const EmissionTimeline& timeline);

  v1::GetCameraResponse describe() const override;
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;
  bool move(bool present) override;  // the simulated motor finishes at once
  // The table's motor stands at this angle; frames from now on show the object so.
  void turn(double degrees);

 private:
  SimCamera(const SimCameraOptions& options, const EmissionTimeline& timeline);
  // What a frame shows; a duplicate repeats that of the previous frame.
  struct Exposed {
    std::int64_t sequence = 0;
    ExposureWindow window;
    bool object = false;
    Turntable table = {};
    double at_s = 0.0;  // since the camera's first start
  };
  bool blurs() const { return options_.blur_sigma_px > 0.0; }
  nanoseconds end_of(const ExposureWindow& window) const;
  absl::StatusOr<Image16> expose_frame(const Exposed& exposed, double exposure_ms);
  // Mean radiance over each row's exposure, of the light known so far.
  absl::StatusOr<RadianceImage> radiance_on(const Exposed& exposed);
  absl::Status apply_automatics(const Exposed& exposed, double exposure_ms, RadianceImage& radiance);
  using Monitors = std::vector<SceneMonitor>;
  // Where monitors and object stand.
  struct Places {
    Monitors monitors;
    Turntable table;
    friend bool operator==(const Places&, const Places&) = default;
  };
  struct TracedStage {
    Places places;
    absl::StatusOr<StageTransports> transports;
  };
  // The light transport for these places; waits while it is traced. UNAVAILABLE: it takes too long.
  absl::StatusOr<StageTransports> stage(const std::vector<EmissionMonitor>& monitors, const Turntable& table);
  std::optional<v1::Preparation> preparation() const;
  Turntable table() const;
  // Traces the stages that frames wait for, and that of the monitors as soon as they are known.
  void prepare(std::stop_token stop);
  // Releases `lock` meanwhile.
  void trace(const Places& wanted, std::unique_lock<std::mutex>& lock, std::stop_token stop);
  const TracedStage* find(const Places& wanted) const;  // null: not traced. Call with stages_mutex_ held

  const SimCameraOptions options_;
  const EmissionTimeline& timeline_;
  const Motion motion_;
  mutable std::mutex mutex_;
  bool object_ = false;              // guarded by mutex_
  Turntable table_;                  // guarded by mutex_
  bool running_ = false;             // guarded by mutex_
  double exposure_ms_ = 0.0;         // guarded by mutex_
  std::int64_t sequence_ = 0;        // guarded by mutex_
  nanoseconds next_start_{};         // guarded by mutex_
  nanoseconds first_start_{};        // 0: never started; guarded by mutex_
  Exposed newest_;                   // that is not a duplicate; guarded by mutex_
  std::mt19937_64 random_;           // guarded by mutex_
  nanoseconds delivered_{};          // when the newest frame was; used by next() only, which has one caller
  mutable std::mutex stages_mutex_;  // guards all below
  std::condition_variable_any asked_changed_;  // for preparing_
  std::condition_variable traced_changed_;     // for those who wait for it
  std::optional<Places> asked_, tracing_;      // that a frame waits for; that are traced now
  double share_ = 0.0;                         // of tracing_ that is done
  std::deque<TracedStage> traced_;             // the newest first
  std::jthread preparing_;
};

}  // namespace glasswing
