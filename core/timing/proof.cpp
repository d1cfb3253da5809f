#include "core/timing/proof.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace glasswing {
namespace {

// Older frames are dropped: the reports of both nodes arrive far sooner.
constexpr nanoseconds kMemory = std::chrono::seconds(5);

}  // namespace

StableWindow stable_window(const std::vector<MonitorWindow>& monitors) {
  assert(!monitors.empty());
  StableWindow window{.step = monitors.front().step,
                      .from = nanoseconds::min(),
                      .until = nanoseconds::max(),
                      .patch_until = nanoseconds::max()};
  for (const MonitorWindow& monitor : monitors) {
    window.from =
        std::max(window.from, monitor.scanout_end + monitor.lag + monitor.settle + monitor.uncertainty);
    const nanoseconds until = monitor.replaced + monitor.lag - monitor.uncertainty;
    window.until = std::min(window.until, until);
    if (monitor.patch_delay > nanoseconds(0))
      window.patch_until = std::min(window.patch_until, until + monitor.patch_delay);
  }
  if (window.patch_until == nanoseconds::max()) window.patch_until = window.until;
  return window;
}

bool proves(const FrameTime& frame, const StableWindow& window) {
  return frame.start - frame.uncertainty >= window.from && frame.end + frame.uncertainty <= window.until &&
         frame.start < frame.end;
}

void FrameMatcher::add_frame(const FrameTime& frame) {
  frames_.emplace(frame.start, frame);
  seen_until_ = std::max(seen_until_.value_or(frame.end), frame.end);
  while (!frames_.empty() && frames_.begin()->first < *seen_until_ - kMemory) frames_.erase(frames_.begin());
  const std::vector<StableWindow> waiting = std::move(open_);
  open_.clear();
  for (const StableWindow& window : waiting) match(window);
}

void FrameMatcher::add_window(const StableWindow& window) {
  match(window);
}

void FrameMatcher::match(const StableWindow& window) {
  for (auto it = frames_.lower_bound(window.from); it != frames_.end() && it->first <= window.until; ++it) {
    if (!proves(it->second, window)) continue;
    matches_.push_back({.step = window.step, .frame = it->second});
    frames_.erase(it);
    return;
  }
  // Frames arrive in time order: one that proves this window may still come unless one has ended past it.
  if (!seen_until_ || *seen_until_ <= window.until) open_.push_back(window);
}

void FrameMatcher::forget_windows() {
  open_.clear();
  matches_.clear();
}

std::vector<FrameMatcher::Match> FrameMatcher::take() {
  return std::exchange(matches_, {});
}

}  // namespace glasswing
