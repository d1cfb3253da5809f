// One run of a camera under libcamera: acquired, configured, streaming, and released at destruction. Only
// libcamera_camera.cpp includes this header, so that libcamera's headers stay out of the rest.
#pragma once

#include <absl/status/statusor.h>
#include <libcamera/libcamera.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "camera-node/backends/pixel_format.h"
#include "camera-node/backends/sensor_time.h"

namespace glasswing {

// The gain of a frame's samples, from its metadata: AnalogueGain, times DigitalGain in formats that a
// processor made of the sensor's samples. None: neither is reported.
std::optional<double> gain_in(const libcamera::ControlList& metadata, PixelFormat::Kind kind);

class LibcameraRun {
 public:
  struct Frame {
    std::shared_ptr<const RawPicture> picture;
    std::int64_t sequence = 0;  // of this run, from 0; gaps are lost frames
    nanoseconds stamp{};        // the driver's
    ClockReadings complete;     // taken when the frame was complete
    // From the frame's metadata, if present.
    std::optional<double> exposure_ms, gain;
    std::optional<nanoseconds> readout;
  };
  // Sends `modes` with the first request and `settings` with the second: USB cameras refuse an exposure time
  // until automatic exposure is off. UNAVAILABLE: another program is using the camera, or it does not start.
  static absl::StatusOr<std::unique_ptr<LibcameraRun>> begin(
      std::shared_ptr<libcamera::Camera> camera,
      std::unique_ptr<libcamera::CameraConfiguration> configuration, bool usb,
      const libcamera::ControlList& modes, const libcamera::ControlList& settings);
  ~LibcameraRun();
  LibcameraRun(const LibcameraRun&) = delete;
  LibcameraRun& operator=(const LibcameraRun&) = delete;

  std::optional<Frame> next(std::chrono::milliseconds timeout);
  // The camera was unplugged.
  bool gone() const { return gone_; }
  // The camera cancelled a request.
  bool refused() const { return refused_; }

 private:
  LibcameraRun(std::shared_ptr<libcamera::Camera> camera,
               std::unique_ptr<libcamera::CameraConfiguration> configuration);
  absl::Status map_buffers(bool usb);
  absl::Status stream(const libcamera::ControlList& modes, const libcamera::ControlList& settings);
  void complete(libcamera::Request* request);  // on libcamera's thread
  void disconnected();                         // on libcamera's thread
  Frame copied(const libcamera::Request& request, const libcamera::FrameBuffer& buffer) const;

  struct Mapping {
    int dmabuf = -1;
    void* start = nullptr;
    size_t size_bytes = 0;
    size_t offset = 0;  // of the plane
  };
  const std::shared_ptr<libcamera::Camera> camera_;
  const std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  libcamera::FrameBufferAllocator allocator_;
  std::map<const libcamera::FrameBuffer*, std::vector<Mapping>> mappings_;
  std::vector<std::unique_ptr<libcamera::Request>> requests_;
  RawPicture blank_;  // the properties that all pictures of the run share
  std::atomic<bool> gone_ = false, refused_ = false;
  std::mutex mutex_;
  std::condition_variable arrived_;
  bool stopping_ = false;     // guarded by mutex_
  std::deque<Frame> frames_;  // guarded by mutex_
};

}  // namespace glasswing
