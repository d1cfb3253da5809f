#include "server/capture/recording.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr size_t kMaxRecent = 4096;

}  // namespace

Recording::Recording(const RigLinks& links, double exposure_ms, const std::string& request_id)
    : links_(links),
      camera_(*links.camera, *links.camera_stub, exposure_ms, request_id,
              !links.camera_info.trigger().empty()) {}

void Recording::begin_showing() {
  matcher_.forget_windows();
  shown_now_.clear();
  matched_now_.clear();
}

bool Recording::add_window(const StableWindow& window) {
  matcher_.add_window(window);
  shown_now_.insert_or_assign(window.step, window);
  return shown_.insert(window.step).second;
}

int Recording::take_frames() {
  int count = 0;
  const v1::Camera& camera = links_.camera_info.camera();
  for (v1::FrameTaken& frame : camera_.inbox.take()) {
    ++count;
    const bool as_requested = std::abs(frame.exposure_ms() - exposure_ms()) <= 0.01 * exposure_ms() &&
                              frame.width_px() == camera.width_px() &&
                              frame.height_px() == camera.height_px();
    if (!as_requested) continue;
    matcher_.add_frame(rig_time_of(frame, *links_.camera));
    recent_.emplace(frame.sequence(), std::move(frame));
    if (recent_.size() > kMaxRecent) recent_.erase(recent_.begin());
  }
  return count;
}

std::vector<FrameMatcher::Match> Recording::take_matches() {
  std::vector<FrameMatcher::Match> matches = matcher_.take();
  for (const FrameMatcher::Match& match : matches) matched_now_.insert(match.step);
  return matches;
}

bool Recording::has_frame_of(int step) const {
  const StableWindow& window = shown_now_.at(step);
  return std::ranges::any_of(recent_, [&](const auto& recent) {
    const FrameTime frame = rig_time_of(recent.second, *links_.camera);
    return frame.start < window.until && frame.end > window.from;
  });
}

std::int64_t Recording::last_of_patch(int step, std::int64_t first) const {
  const StableWindow& window = shown_now_.at(step);
  for (auto recent = recent_.rbegin(); recent != recent_.rend() && recent->first > first; ++recent) {
    const FrameTime frame = rig_time_of(recent->second, *links_.camera);
    if (frame.end + frame.uncertainty <= window.patch_until) return frame.sequence;
  }
  return first;
}

std::vector<FrameTime> Recording::recent_frames() const {
  std::vector<FrameTime> frames;
  for (const auto& [sequence, taken] : recent_) frames.push_back(rig_time_of(taken, *links_.camera));
  return frames;
}

const v1::FrameTaken* Recording::taken(const FrameMatcher::Match& match) const {
  const auto found = recent_.find(match.frame.sequence);
  return found == recent_.end() ? nullptr : &found->second;
}

}  // namespace glasswing
