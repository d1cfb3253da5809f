#include "camera-node/services/frame_ring.h"

#include <algorithm>

namespace glasswing {

void FrameRing::push(CapturedFrame frame, size_t max_frames) {
  {
    const std::lock_guard lock(mutex_);
    held_bytes_ += frame.held_bytes;
    frames_.push_back(std::move(frame));
    while (frames_.size() > max_frames || (held_bytes_ > kMaxHeld_bytes && frames_.size() > 1)) {
      held_bytes_ -= frames_.front().held_bytes;
      frames_.pop_front();
    }
  }
  pushed_.notify_all();
}

void FrameRing::clear() {
  const std::lock_guard lock(mutex_);
  frames_.clear();
  held_bytes_ = 0;
}

std::deque<CapturedFrame> FrameRing::all() const {
  const std::lock_guard lock(mutex_);
  return frames_;
}

std::optional<CapturedFrame> FrameRing::newest() const {
  const std::lock_guard lock(mutex_);
  return frames_.empty() ? std::nullopt : std::optional(frames_.back());
}

std::optional<CapturedFrame> FrameRing::wait_newer(std::int64_t sequence,
                                                   std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  const auto is_there = [&] { return !frames_.empty() && frames_.back().taken.sequence() != sequence; };
  return pushed_.wait_for(lock, timeout, is_there) ? std::optional(frames_.back()) : std::nullopt;
}

std::optional<CapturedFrame> FrameRing::find(std::int64_t sequence) const {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(frames_.begin(), frames_.end(), [&](const CapturedFrame& frame) {
    return frame.taken.sequence() == sequence;
  });
  return found == frames_.end() ? std::nullopt : std::optional(*found);
}

}  // namespace glasswing
