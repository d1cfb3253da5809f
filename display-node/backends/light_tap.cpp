#include "display-node/backends/light_tap.h"

#include <algorithm>

namespace glasswing {
namespace {

// The log's size, which is how far a reader may fall behind; at least two pictures a monitor.
constexpr size_t kLogBytes = size_t{256} << 20;
constexpr size_t kMaxLogged = 256;
// No picture starts earlier than this before the time it was asked for; larger than any display's
// uncertainty.
constexpr nanoseconds kEarly = std::chrono::milliseconds(5);

size_t log_limit_of(const std::vector<ScreenInfo>& screens) {
  size_t largest_bytes = 1;
  for (const ScreenInfo& screen : screens) {
    const size_t pixels = static_cast<size_t>(screen.width_px) * screen.height_px;
    largest_bytes = std::max(largest_bytes, pixels * 3 * sizeof(std::uint16_t));
  }
  return std::max(std::min(kLogBytes / largest_bytes, kMaxLogged), 2 * screens.size());
}

}  // namespace

LightTap::LightTap(Display& display)
    : display_(display), log_limit_(log_limit_of(display.screens())), poses_(display.screens().size()) {
  for (size_t i = 0; i < display.screens().size(); ++i)
    current_.push_back({.monitor = i, .scanout_start = monotonic_now(), .picture = nullptr});
}

absl::StatusOr<std::vector<Scanout>> LightTap::show(const std::vector<Picture>& pictures, nanoseconds at) {
  {
    const std::lock_guard lock(mutex_);
    show_began_ = monotonic_now();
    shows_nothing_to_ = std::max(show_began_, at - kEarly);
  }
  absl::StatusOr<std::vector<Scanout>> scanouts = display_.show(pictures, at);
  {
    const std::lock_guard lock(mutex_);
    show_began_ = {};
    if (!scanouts.ok()) return scanouts;
    for (size_t i = 0; i < current_.size(); ++i) {
      current_[i].scanout_start = (*scanouts)[i].start;
      current_[i].picture = i < pictures.size() ? pictures[i] : nullptr;
      if (is_read_) log_.push_back(current_[i]);
      ++next_;
    }
    while (log_.size() > log_limit_) log_.pop_front();
  }
  emitted_.notify_all();
  return scanouts;
}

void LightTap::place(size_t monitor, const PanelPose& pose) {
  {
    const std::lock_guard lock(mutex_);
    poses_[monitor] = pose;
    if (!is_read_) return;
    log_.push_back({.monitor = monitor, .scanout_start = monotonic_now(), .picture = nullptr, .pose = pose});
    ++next_;
    while (log_.size() > log_limit_) log_.pop_front();
  }
  emitted_.notify_all();
}

bool LightTap::read(std::uint64_t& cursor, std::vector<Emission>& emissions, nanoseconds& horizon,
                    std::chrono::milliseconds timeout) {
  emissions.clear();
  std::unique_lock lock(mutex_);
  if (cursor == 0) {
    is_read_ = true;
    emissions = current_;
    for (size_t i = 0; i < poses_.size(); ++i) {
      if (poses_[i] != PanelPose())
        emissions.push_back({.monitor = i, .scanout_start = {}, .picture = nullptr, .pose = poses_[i]});
    }
  } else {
    emitted_.wait_for(lock, timeout, [&] { return next_ > cursor; });
    const std::uint64_t first = next_ - log_.size();
    if (cursor < first) return false;
    emissions.assign(log_.begin() + cursor - first, log_.end());
  }
  cursor = next_;
  // A show that is not yet asked for starts after now.
  horizon = monotonic_now();
  if (show_began_ > nanoseconds(0)) horizon = std::min(horizon, shows_nothing_to_);
  return true;
}

}  // namespace glasswing
