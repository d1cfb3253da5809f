#include "server/rig/node_streams.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr std::int64_t kSyncErrors =
    3;  // standard errors of measured lag and settling that a proof allows for

}  // namespace

CaptureStream::CaptureStream(NodeLink& camera, v1::CameraService::Stub& stub, double exposure_ms,
                             const std::string& request_id, bool triggered)
    : camera_(camera), exposure_ms_(exposure_ms) {
  v1::CaptureRequest request;
  request.set_request_id(request_id);
  request.set_exposure_ms(exposure_ms);
  request.set_triggered(triggered);
  reader_ = stub.Capture(&context_, request);
  thread_ = std::thread([this] { read(); });
}

CaptureStream::~CaptureStream() {
  context_.TryCancel();
  thread_.join();
}

absl::Status CaptureStream::wait_running(std::stop_token stop, nanoseconds within) {
  nanoseconds asked_at = monotonic_now();
  GW_RETURN_IF_ERROR(camera_.wait("start the camera", stop, [&](std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    const bool ended = started_.wait_for(lock, stop, std::min(nanoseconds(time), within),
                                         [this] { return running_ || inbox.end().has_value(); });
    if (std::exchange(prepares_, false)) asked_at = monotonic_now();  // one that prepares is not late
    return ended || monotonic_now() - asked_at >= within;
  }));
  const std::lock_guard lock(mutex_);
  if (running_) return absl::OkStatus();
  return inbox.end().value_or(absl::DeadlineExceededError(camera_.title() + " did not start in time"));
}

void CaptureStream::read() {
  v1::CaptureResponse response;
  while (reader_->Read(&response)) {
    if (response.has_frame()) {
      inbox.push(std::move(*response.mutable_frame()));
      continue;
    }
    const std::lock_guard lock(mutex_);
    (response.has_preparation() ? prepares_ : running_) = true;
    started_.notify_all();
  }
  absl::Status status = from_grpc(reader_->Finish(), camera_.title());
  if (status.ok()) status = absl::UnavailableError(camera_.title() + " stopped sending frames");
  inbox.close(std::move(status));
  const std::lock_guard lock(mutex_);
  started_.notify_all();
}

FrameTime rig_time_of(const v1::FrameTaken& frame, const NodeLink& camera) {
  const ClockReading start = camera.rig_from_node(nanoseconds(frame.exposure_start_ns())),
                     end = camera.rig_from_node(nanoseconds(frame.exposure_end_ns()));
  return {.sequence = frame.sequence(),
          .start = start.time,
          .end = end.time,
          .uncertainty = nanoseconds(frame.uncertainty_ns()) + std::max(start.error, end.error)};
}

PresentationStream::PresentationStream(const DisplayLink& display, const std::string& program,
                                       nanoseconds start_at, nanoseconds step,
                                       std::function<void(const v1::Presentation&)> seen, bool hold_last)
    : display_(display) {
  // Over this time the clocks' rates matter.
  constexpr int kManySteps = 10000;
  const nanoseconds start = display.link.node_from_rig(start_at).time,
                    end = display.link.node_from_rig(start_at + kManySteps * step).time;
  v1::PlayProgramRequest request;
  request.set_program(program);
  request.set_start_at_ns(start.count());
  request.set_step_ns(((end - start) / kManySteps).count());
  request.set_hold_last(hold_last);
  reader_ = display.stub->PlayProgram(&context_, request);
  thread_ = std::thread([this, seen = std::move(seen)] {
    v1::PlayProgramResponse response;
    while (reader_->Read(&response)) {
      inbox.push(response.presentation());
      if (seen) seen(response.presentation());
    }
    inbox.close(from_grpc(reader_->Finish(), display_.link.title()));
  });
}

PresentationStream::~PresentationStream() {
  context_.TryCancel();
  thread_.join();
}

nanoseconds step_time(std::span<const DisplayLink* const> displays, int hold_refreshes) {
  double slowest_hz = std::numeric_limits<double>::max();
  for (const DisplayLink* display : displays) {
    for (const v1::DisplayMonitor& monitor : display->info.monitors())
      slowest_hz = std::min(slowest_hz, monitor.refresh_hz());
  }
  return nanoseconds(std::llround(hold_refreshes * 1e9 / slowest_hz));
}

nanoseconds common_step(std::span<const DisplayLink* const> displays, int hold_refreshes) {
  return displays.size() < 2 ? nanoseconds(0) : step_time(displays, hold_refreshes);
}

MonitorWindow rig_time_of(const v1::Presentation& shown, const DisplayLink& display) {
  const v1::DisplayMonitor* monitor = display.monitor(shown.monitor());
  const bool held = shown.replaced_ns() == 0;  // still shown
  const ClockReading scanout_end = display.link.rig_from_node(nanoseconds(shown.scanout_end_ns())),
                     replaced =
                         held ? scanout_end : display.link.rig_from_node(nanoseconds(shown.replaced_ns()));
  MonitorWindow window{
      .step = shown.step(),
      .scanout_end = scanout_end.time,
      .replaced = replaced.time,
      .uncertainty = nanoseconds(shown.uncertainty_ns()) + std::max(scanout_end.error, replaced.error)};
  if (monitor != nullptr && monitor->patch_rows() > 0) {
    const double above = static_cast<double>(monitor->height_px()) /
                         static_cast<double>(monitor->height_px() + monitor->patch_rows());
    window.patch_delay = nanoseconds(
        std::llround(above * static_cast<double>(shown.scanout_end_ns() - shown.scanout_start_ns())));
  }
  add_light_times(shown.monitor(), display, window);
  return window;
}

void add_light_times(const std::string& monitor, const DisplayLink& display, MonitorWindow& window) {
  if (const auto measured = display.sync.find(monitor); measured != display.sync.end()) {
    window.lag = nanoseconds(measured->second.lag_ns());
    window.settle = nanoseconds(measured->second.settle_ns());
    window.uncertainty +=
        nanoseconds(kSyncErrors * measured->second.error_ns() + measured->second.clock_error_ns());
  } else if (const v1::DisplayMonitor* const declared = display.monitor(monitor)) {
    window.lag = nanoseconds(declared->optical_lag_ns());
    window.settle = nanoseconds(declared->settle_ns());
  }
}

}  // namespace glasswing
