// A GenICam camera (GigE Vision, USB3 Vision) driven by Aravis 0.8, with manual exposure, gain and black
// level.
//
// start() sets the exposure and reads it back, then triggers some frames by software, from which StampClock
// learns how the camera's timestamps relate to this machine's clock; for a camera without software triggers
// the arrival delay is an option. Frames are copied out of Aravis' buffers when they are complete; incomplete
// ones are counted and dropped.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "camera-node/backends/aravis/stamp_clock.h"
#include "camera-node/backends/pixel_format.h"
#include "camera-node/camera.h"
#include "core/image/image_file.h"

namespace glasswing {

class AravisDevice;
class AravisRun;

class AravisCamera final : public Camera {
 public:
  struct Offset {
    int x_px = 0, y_px = 0;
  };
  struct Options {
    std::string name = "camera-1";
    std::string device;               // id, model, serial number or address, or a part; empty: the only one
    std::string format;               // GenICam's name; empty: as the camera is set
    std::optional<PictureSize> size;  // default: the whole sensor
    std::optional<Offset> offset;     // of the picture on the sensor; default: centred
    std::optional<double> frame_rate_hz;      // default: as the camera is set
    std::optional<double> gain, black_level;  // the camera's units; default: as the camera is set
    std::string trigger;                      // of captures: "software" or a line; empty: they run freely
    int packet_bytes = 1400;                  // GigE Vision
    nanoseconds readout{};                    // from the first row's start to the last row's start
    nanoseconds trigger_delay = std::chrono::milliseconds(2);  // max, to the start of the exposure
    std::optional<nanoseconds> line_delay;                     // from the line's edge to the exposure's start
    std::optional<nanoseconds> delay;  // max, from exposure to arrival, without software triggers
    std::string ptp;  // what a timestamp means by this machine's clock: "start", "end"; empty: unknown
    nanoseconds ptp_error = std::chrono::microseconds(100);  // max, between the two clocks
  };
  // Runs the camera for some frames to measure its rate. NOT_FOUND: not exactly one camera matches.
  // INVALID_ARGUMENT: an unsupported option. Both list what is available. UNAVAILABLE: another program uses
  // the camera, or it delivers no frames.
  static absl::StatusOr<std::unique_ptr<AravisCamera>> open(const Options& options);
  ~AravisCamera() override;

  v1::GetCameraResponse describe() const override;
  // UNAVAILABLE: the camera is unplugged or delivers no frames. FAILED_PRECONDITION: it does not apply its
  // settings.
  absl::Status start(double exposure_ms) override { return start(exposure_ms, ""); }
  absl::Status start_triggered(double exposure_ms) override { return start(exposure_ms, options_.trigger); }
  absl::Status trigger(nanoseconds at) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;

 private:
  explicit AravisCamera(const Options& options);
  // Opens the device and sets everything except the exposure.
  absl::Status connect();
  absl::Status set_format();
  absl::Status set_region();
  absl::Status set_light();
  absl::Status check_trigger();
  absl::Status learn_exposures();
  absl::Status learn_rate();
  void warn_of_small_socket() const;
  absl::Status start(double exposure_ms, const std::string& trigger);
  absl::Status set_exposure(double exposure_ms);
  absl::Status begin(const std::string& trigger);
  absl::Status learn_stamps();
  Sighting sighting_of(nanoseconds stamp, nanoseconds first, nanoseconds complete) const;
  void count_packets();
  void read_temperature();
  // The start of a frame's exposure.
  ClockReading start_of(nanoseconds stamp);
  void drop(const std::string& why);

  const Options options_;
  std::shared_ptr<AravisDevice> device_;
  bool software_trigger_ = false;
  const PixelFormat* format_ = nullptr;
  PictureSize size_;
  double min_exposure_ms_ = 0.0, max_exposure_ms_ = 0.0, gain_ = 1.0;
  nanoseconds period_{};      // of a frame
  double exposure_ms_ = 0.0;  // of this run
  nanoseconds line_delay_{};  // as the camera is set
  bool gain_is_db_ = false;
  bool ptp_holds_ = true;  // in this run
  StampClock clock_;       // of this run
  std::int64_t sequence_ = 0;
  std::uint64_t last_id_ = 0;
  std::uint64_t counted_packets_ = 0;  // of this run, that were missing
  nanoseconds temperature_at_{};
  mutable std::mutex mutex_;
  std::unique_ptr<AravisRun> run_;       // replaced under mutex_
  std::optional<double> temperature_c_;  // guarded by mutex_
  std::atomic<std::int64_t> dropped_frames_ = 0, dropped_packets_ = 0;
};

}  // namespace glasswing
