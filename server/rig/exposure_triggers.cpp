#include "server/rig/exposure_triggers.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "core/service/service.h"
#include "server/rig/node_streams.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kTriggered(1);
// After the last picture: the frame shows that no more will come.
constexpr nanoseconds kTail = std::chrono::milliseconds(60);

}  // namespace

ExposureTriggers::ExposureTriggers(const RigLinks& links, int pictures, int monitor_count, nanoseconds hold,
                                   double exposure_ms)
    : links_(links),
      pictures_(static_cast<size_t>(pictures)),
      monitor_count_(static_cast<size_t>(monitor_count)),
      hold_(hold),
      length_(nanoseconds(std::llround(1e6 * exposure_ms) + links.camera_info.readout_ns())) {}

void ExposureTriggers::note(const v1::Presentation& replaced, const DisplayLink& display) {
  v1::Presentation next = replaced;
  next.set_scanout_start_ns(replaced.replaced_ns());
  next.set_scanout_end_ns(replaced.replaced_ns() + replaced.scanout_end_ns() - replaced.scanout_start_ns());
  next.set_replaced_ns(replaced.replaced_ns() + hold_.count());
  std::vector<MonitorWindow> windows;
  size_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    number = ++reports_[replaced.monitor()];
    next_[number].push_back(rig_time_of(next, display));
    if (next_[number].size() < monitor_count_) return;
    windows = std::move(next_[number]);
    next_.erase(number);
  }
  expose(number < pictures_ ? middle_of(windows) : stable_window(windows).from + kTail);
}

nanoseconds ExposureTriggers::middle_of(const std::vector<MonitorWindow>& next) const {
  const StableWindow window = stable_window(next);
  return (window.from + window.until - length_) / 2;
}

void ExposureTriggers::expose(nanoseconds at) const {
  v1::ExposeRequest request;
  request.set_at_ns(links_.camera->node_from_rig(at).time.count());
  v1::ExposeResponse response;
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kTriggered);
  const grpc::Status status = links_.camera_stub->Expose(&context, request, &response);
  if (!status.ok()) spdlog::debug("exposure not triggered error=\"{}\"", status.error_message());
}

absl::StatusOr<std::optional<v1::LinePulse>> line_pulse(const RigLinks& links, const DisplayLink& display,
                                                        int hold_refreshes, double exposure_ms) {
  const v1::GetCameraResponse& camera = links.camera_info;
  const auto has_line = [](const auto& each) { return !each->info.line().empty(); };
  const auto raising = std::ranges::find_if(links.displays, has_line);
  if (camera.trigger().empty() || ExposureTriggers::are_wanted(links) || raising == links.displays.end() ||
      raising->get() != &display)
    return std::nullopt;
  // Of a picture whose scan-out begins at 0 on all monitors.
  std::vector<const DisplayLink*> displays;
  for (const auto& each : links.displays) displays.push_back(each.get());
  const nanoseconds hold = step_time(displays, hold_refreshes);
  std::vector<MonitorWindow> windows;
  for (const DisplayLink* each : displays) {
    for (const v1::DisplayMonitor& monitor : each->info.monitors()) {
      windows.push_back(
          {.scanout_end = nanoseconds(std::llround(1e9 / monitor.refresh_hz())), .replaced = hold});
      add_light_times(monitor.name(), *each, windows.back());
    }
  }
  const StableWindow window = stable_window(windows);
  const nanoseconds length(std::llround(1e6 * exposure_ms) + camera.readout_ns());
  const nanoseconds delay(camera.line_delay_ns()), latest = window.until - length;
  const nanoseconds exposed = std::max((window.from + latest) / 2, delay);
  if (exposed > latest || latest < window.from) {
    const auto ms = [](nanoseconds time) { return static_cast<double>(time.count()) / 1e6; };
    return absl::InvalidArgumentError(
        fmt::format("a picture is shown for {:.4g} ms and stands still from {:.4g} to {:.4g} ms; the camera "
                    "needs {:.4g} ms in it, and begins {:.4g} ms after its line rises (--line-delay-ms): "
                    "raise hold_refreshes, or lower the delay or the exposure",
                    ms(hold), ms(window.from), ms(window.until), ms(length), ms(delay)));
  }
  v1::LinePulse pulse;
  pulse.set_after_ns((exposed - delay).count());
  pulse.set_slack_ns((latest - exposed).count());
  return pulse;
}

}  // namespace glasswing
