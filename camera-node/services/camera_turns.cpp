#include "camera-node/services/camera_turns.h"

#include <algorithm>
#include <chrono>

#include "core/base/time.h"

namespace glasswing {
namespace {

constexpr nanoseconds kReleased = std::chrono::seconds(1);  // a preview needs a moment to release the camera
constexpr std::chrono::milliseconds kPoll(20);              // for callers who have gone

}  // namespace

absl::Status CameraTurns::take(CameraCall& call) {
  std::unique_lock lock(mutex_);
  const auto replace = [&](CameraCall& earlier) {
    if (!call.id.empty() && earlier.id == call.id) earlier.replaced = true;
  };
  if (holder_ != nullptr) replace(*holder_);
  for (CameraCall* earlier : waiting_) replace(*earlier);
  waiting_.push_back(&call);
  const absl::Status waited = wait(call, lock);
  waiting_.remove(&call);
  if (waited.ok()) holder_ = &call;
  ended_.notify_all();
  return waited;
}

absl::Status CameraTurns::wait(CameraCall& call, std::unique_lock<std::mutex>& lock) {
  nanoseconds refused_at = monotonic_now() + kReleased;
  while (holder_ != &call) {  // hand_over() may have made it the holder
    if (call.replaced) return absl::AbortedError("a later call of the same client has taken over the camera");
    if (call.is_gone()) return absl::CancelledError("the caller no longer waits for the camera");
    if (holder_ == nullptr && waiting_.front() == &call) return absl::OkStatus();
    const bool ending = holder_ == nullptr || holder_->replaced || holder_->is_gone();
    if (ending) refused_at = monotonic_now() + kReleased;
    if (monotonic_now() > refused_at) {
      return absl::FailedPreconditionError(
          "the camera is capturing for another client; try again when it is free");
    }
    ended_.wait_for(lock, kPoll);
  }
  return absl::OkStatus();
}

bool CameraTurns::try_take(CameraCall& call) {
  const std::lock_guard lock(mutex_);
  if (holder_ != nullptr || !waiting_.empty()) return false;
  holder_ = &call;
  return true;
}

bool CameraTurns::is_wanted() const {
  const std::lock_guard lock(mutex_);
  return !waiting_.empty();
}

bool CameraTurns::hand_over(const CameraCall& call) {
  const std::lock_guard lock(mutex_);
  const auto next = std::ranges::find_if(waiting_, [&](const CameraCall* later) {
    return !call.id.empty() && later->id == call.id && !later->replaced;
  });
  if (next == waiting_.end() || (*next)->exposure_ms != call.exposure_ms ||
      (*next)->triggered != call.triggered)
    return false;
  (*next)->started = true;
  holder_ = *next;
  ended_.notify_all();
  return true;
}

void CameraTurns::end(const CameraCall& call) {
  const std::lock_guard lock(mutex_);
  if (holder_ == &call) holder_ = nullptr;
  ended_.notify_all();
}

}  // namespace glasswing
