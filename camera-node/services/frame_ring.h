// The camera's newest frames, which KeepFrames, LearnPatches, MeasureLight and Preview read.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

#include "camera-node/camera.h"

namespace glasswing {

// Thread-safe.
class FrameRing {
 public:
  static constexpr size_t kMaxHeld_bytes = size_t{1} << 30;
  // Drops the oldest frames beyond `max_frames` or kMaxHeld_bytes of held buffers. The newest frame always
  // stays.
  void push(CapturedFrame frame, size_t max_frames);
  void clear();
  // Oldest first.
  std::deque<CapturedFrame> all() const;
  // None: the ring is empty.
  std::optional<CapturedFrame> newest() const;
  // Waits for a newest frame other than `sequence`; none after `timeout`.
  std::optional<CapturedFrame> wait_newer(std::int64_t sequence, std::chrono::milliseconds timeout) const;
  // None: it has left the ring.
  std::optional<CapturedFrame> find(std::int64_t sequence) const;

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable pushed_;
  std::deque<CapturedFrame> frames_;  // guarded by mutex_
  size_t held_bytes_ = 0;             // sum over frames_; guarded by mutex_
};

}  // namespace glasswing
