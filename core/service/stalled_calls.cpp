#include "core/service/stalled_calls.h"

#include <grpcpp/server_context.h>
#include <spdlog/spdlog.h>

#include <optional>
#include <string>

#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;
using grpc::experimental::InterceptionHookPoints;
using Type = grpc::experimental::ServerRpcInfo::Type;

}  // namespace

class StalledCallsFactory::Calls {
 public:
  class Call;
  void enter(Call* call) {
    const std::lock_guard lock(mutex_);
    running_.insert(call);
  }
  void leave(Call* call) {
    const std::lock_guard lock(mutex_);
    running_.erase(call);
  }
  void cancel_stalled(std::chrono::milliseconds most);

 private:
  std::mutex mutex_;
  std::set<Call*> running_;  // guarded by mutex_
};

// A call that waits cannot end while cancel_if_since() holds the lock, because ending the wait takes the lock
// first.
class StalledCallsFactory::Calls::Call final : public grpc::experimental::Interceptor {
 public:
  Call(std::shared_ptr<Calls> calls, grpc::experimental::ServerRpcInfo* info)
      : calls_(std::move(calls)), info_(info), takes_stream_(info->type() == Type::CLIENT_STREAMING) {
    if (takes_stream_) since_ = Clock::now();
    calls_->enter(this);
  }
  ~Call() override { calls_->leave(this); }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    const auto at = [&](InterceptionHookPoints point) { return methods->QueryInterceptionHookPoint(point); };
    if (takes_stream_) {
      // There is no hook for the start of a read, so the time spent on the previous message counts too.
      if (at(InterceptionHookPoints::POST_RECV_MESSAGE)) {
        wait_since(methods->GetRecvMessage() == nullptr ? std::nullopt : std::optional(Clock::now()));
      } else if (at(InterceptionHookPoints::PRE_SEND_STATUS)) {
        wait_since(std::nullopt);
      }
    } else if (at(InterceptionHookPoints::PRE_SEND_MESSAGE)) {
      wait_since(Clock::now());
    } else if (at(InterceptionHookPoints::POST_SEND_MESSAGE)) {
      wait_since(std::nullopt);
    }
    methods->Proceed();
  }

  void cancel_if_since(Clock::time_point before) {
    const std::lock_guard lock(mutex_);
    if (!since_ || *since_ > before) return;
    since_.reset();
    spdlog::warn("a call is ended: its other side has stopped method={} peer={}", info_->method(),
                 info_->server_context()->peer());
    counter("glasswing_rpcs_stalled_total", "Calls that were cancelled because their peer had stalled.")
        .Increment();
    info_->server_context()->TryCancel();
  }

 private:
  void wait_since(std::optional<Clock::time_point> time) {
    const std::lock_guard lock(mutex_);
    since_ = time;
  }

  const std::shared_ptr<Calls> calls_;
  grpc::experimental::ServerRpcInfo* const info_;
  const bool takes_stream_;
  std::mutex mutex_;
  std::optional<Clock::time_point> since_;  // guarded by mutex_; when the wait for a message began
};

void StalledCallsFactory::Calls::cancel_stalled(std::chrono::milliseconds most) {
  const Clock::time_point before = Clock::now() - most;
  const std::lock_guard lock(mutex_);
  for (Call* call : running_) call->cancel_if_since(before);
}

StalledCallsFactory::StalledCallsFactory(std::chrono::milliseconds most)
    : calls_(std::make_shared<Calls>()), watch_([most, calls = calls_](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any woken;
        std::unique_lock lock(mutex);
        while (!woken.wait_for(lock, stop, most / 4, [&] { return stop.stop_requested(); }))
          calls->cancel_stalled(most);
      }) {}

StalledCallsFactory::~StalledCallsFactory() = default;

grpc::experimental::Interceptor* StalledCallsFactory::CreateServerInterceptor(
    grpc::experimental::ServerRpcInfo* info) {
  return info->type() == Type::SERVER_STREAMING || info->type() == Type::CLIENT_STREAMING
             ? new Calls::Call(calls_, info)
             : nullptr;
}

}  // namespace glasswing
