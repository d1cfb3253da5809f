#include "display-node/backends/pulsed_display.h"

#include <algorithm>

#include "core/base/status.h"
#include "display-node/display_metrics.h"

namespace glasswing {

PulsedDisplay::PulsedDisplay(Display& display, std::unique_ptr<TriggerLine> line)
    : display_(display),
      line_(std::move(line)),
      thread_([this](const std::stop_token& stop) { pulse_all(stop); }) {}

PulsedDisplay::~PulsedDisplay() = default;

void PulsedDisplay::arm(std::optional<Pulse> pulse) {
  const std::lock_guard lock(mutex_);
  armed_ = pulse;
  due_.clear();
  failure_ = absl::OkStatus();
}

absl::StatusOr<std::vector<Scanout>> PulsedDisplay::show(const std::vector<Picture>& pictures,
                                                         nanoseconds at) {
  {
    const std::lock_guard lock(mutex_);
    if (!failure_.ok()) return failure_;
  }
  GW_ASSIGN_OR_RETURN(std::vector<Scanout> scanouts, display_.show(pictures, at));
  const std::lock_guard lock(mutex_);
  if (armed_) due_.push_back(std::ranges::max(scanouts, {}, &Scanout::start).start + armed_->after);
  due_changed_.notify_all();
  return scanouts;
}

void PulsedDisplay::pulse_all(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (due_changed_.wait(lock, stop, [this] { return !due_.empty(); })) {
    const nanoseconds due = due_.front();
    due_.pop_front();
    const nanoseconds latest = due + (armed_ ? armed_->slack : nanoseconds(0));
    lock.unlock();
    sleep_until_monotonic(due);
    absl::Status raised;
    if (monotonic_now() <= latest)
      raised = line_->pulse();
    else
      display_metrics().pulses_skipped.Increment();
    lock.lock();
    if (!raised.ok()) {
      failure_ =
          absl::UnavailableError("the trigger line cannot be raised: " + std::string(raised.message()));
      armed_.reset();
    }
  }
}

}  // namespace glasswing
