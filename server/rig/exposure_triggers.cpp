#include "server/rig/exposure_triggers.h"

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

}  // namespace glasswing
