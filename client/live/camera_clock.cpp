#include "client/live/camera_clock.h"

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr int kFirstExchanges = 16;
constexpr std::chrono::milliseconds kBetweenExchanges(250);

}  // namespace

absl::StatusOr<std::unique_ptr<CameraClock>> CameraClock::follow(const std::string& camera_address) {
  std::unique_ptr<CameraClock> clock(new CameraClock(camera_address));
  for (int i = 0; i < kFirstExchanges; ++i) GW_RETURN_IF_ERROR(clock->exchange());
  clock->thread_ = std::jthread([self = clock.get()](std::stop_token stop) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any never;
    // If the camera stops answering, its frames stop too, which ends the program.
    while (!never.wait_for(lock, stop, kBetweenExchanges, [&] { return stop.stop_requested(); }))
      self->exchange().IgnoreError();
  });
  return clock;
}

absl::Status CameraClock::exchange() {
  const nanoseconds sent = monotonic_now();
  GW_ASSIGN_OR_RETURN(const v1::ExchangeResponse response,
                      call(camera_, &v1::ClockService::Stub::Exchange, {}, std::chrono::seconds(2)));
  const nanoseconds returned = monotonic_now();
  const std::lock_guard lock(mutex_);
  clock_.add({.sent = sent,
              .received = nanoseconds(response.received_ns()),
              .answered = nanoseconds(response.sent_ns()),
              .returned = returned});
  return absl::OkStatus();
}

ClockReading CameraClock::local(nanoseconds camera_time) const {
  const std::lock_guard lock(mutex_);
  return clock_.rig_from_node(camera_time);
}

}  // namespace glasswing
