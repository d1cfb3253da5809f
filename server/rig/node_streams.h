// What the nodes stream while pictures are shown and recorded, brought to the thread that wants it, in rig
// time.
#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "core/timing/proof.h"
#include "server/rig/rig_link.h"

namespace glasswing {

// What a stream's reader thread hands to the capture's own thread.
template <typename T>
class Inbox {
 public:
  void push(T item) {
    const std::lock_guard lock(mutex_);
    items_.push_back(std::move(item));
  }
  std::deque<T> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(items_, {});
  }
  void close(absl::Status status) {
    const std::lock_guard lock(mutex_);
    end_ = std::move(status);
  }
  std::optional<absl::Status> end() const {
    const std::lock_guard lock(mutex_);
    return end_;
  }

 private:
  mutable std::mutex mutex_;
  std::deque<T> items_;
  std::optional<absl::Status> end_;
};

// A camera's running Capture call; it ends with this object.
class CameraStream {
 public:
  CameraStream(const NodeLink& camera, v1::CameraService::Stub& stub, double exposure_ms);
  ~CameraStream();

  // Returns when the camera runs as asked. DEADLINE_EXCEEDED after 20 s.
  absl::Status wait_running(std::stop_token stop);
  double exposure_ms() const { return exposure_ms_; }

  Inbox<v1::FrameTaken> inbox;  // times are the node's

 private:
  void read();

  const NodeLink& camera_;
  const double exposure_ms_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::CaptureResponse>> reader_;
  std::mutex mutex_;
  std::condition_variable_any started_;
  bool running_ = false;
  std::thread thread_;
};

// When a frame was exposed, by the link's clock model.
FrameTime rig_time_of(const v1::FrameTaken& frame, const NodeLink& camera);

// A display's running PlayProgram call; it ends with this object.
class DisplayStream {
 public:
  // `start_at` and `step` are rig time; see PlayProgramRequest.
  DisplayStream(const DisplayLink& display, const std::string& program, nanoseconds start_at,
              nanoseconds step = {});
  ~DisplayStream();

  Inbox<v1::Presentation> inbox;  // times are the node's

 private:
  const DisplayLink& display_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::PlayProgramResponse>> reader_;
  std::thread thread_;
};

// What `step` must be for displays of several nodes to keep together, each holding a step for at least
// `hold_refreshes`; 0 for one node alone, whose monitors wait for each other.
nanoseconds common_step(std::span<const DisplayLink* const> displays, int hold_refreshes);

// When a monitor showed a step, by the link's clock model.
MonitorWindow rig_time_of(const v1::Presentation& shown, const DisplayLink& display);

}  // namespace glasswing
