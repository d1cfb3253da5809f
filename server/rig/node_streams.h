// The streams of camera and display nodes while pictures are shown and recorded.
#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <deque>
#include <functional>
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

// Passes items from a stream's reader thread to the capture's thread.
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

// A camera's running Capture call, ended by the destructor.
class CaptureStream {
 public:
  // `request_id`, `triggered`: CaptureRequest's.
  CaptureStream(NodeLink& camera, v1::CameraService::Stub& stub, double exposure_ms,
                const std::string& request_id, bool triggered = false);
  ~CaptureStream();

  // Returns when the camera is running at the requested exposure, after it has prepared, which may take
  // minutes. DEADLINE_EXCEEDED: it does neither `within` this time, or the node does not even answer its
  // clock. CANCELLED: stopped.
  absl::Status wait_running(std::stop_token stop, nanoseconds within = nanoseconds::max());
  double exposure_ms() const { return exposure_ms_; }
  void cancel() { context_.TryCancel(); }

  Inbox<v1::FrameTaken> inbox;  // times are the node's

 private:
  void read();

  NodeLink& camera_;
  const double exposure_ms_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::CaptureResponse>> reader_;
  std::mutex mutex_;
  std::condition_variable_any started_;
  bool running_ = false, prepares_ = false;  // said since the last look
  std::thread thread_;
};

// The frame's exposure in rig time, using the link's clock model.
FrameTime rig_time_of(const v1::FrameTaken& frame, const NodeLink& camera);

// A display's running PlayProgram call, ended by the destructor.
class PresentationStream {
 public:
  // `start_at` and `step` are rig time; see PlayProgramRequest. `seen` receives each report at once, on the
  // stream's own thread.
  PresentationStream(const DisplayLink& display, const std::string& program, nanoseconds start_at,
                     nanoseconds step = {}, std::function<void(const v1::Presentation&)> seen = {},
                     bool hold_last = false);
  ~PresentationStream();

  Inbox<v1::Presentation> inbox;  // times are the node's

 private:
  const DisplayLink& display_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::PlayProgramResponse>> reader_;
  std::thread thread_;
};

// The duration of a step held for `hold_refreshes` on the slowest of the displays' monitors.
nanoseconds step_time(std::span<const DisplayLink* const> displays, int hold_refreshes);

// The duration of a step that keeps displays of several nodes together, each showing a step for at least
// `hold_refreshes`. 0 for one node, whose monitors wait for each other.
nanoseconds common_step(std::span<const DisplayLink* const> displays, int hold_refreshes);

// The time in which a monitor showed a step, in rig time using the link's clock model.
MonitorWindow rig_time_of(const v1::Presentation& shown, const DisplayLink& display);
// Sets lag and settling, measured ones if there are any, and adds their uncertainty.
void add_light_times(const std::string& monitor, const DisplayLink& display, MonitorWindow& window);

}  // namespace glasswing
