#include "client/live/ramp_holder.h"

#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kBetweenQuestions(1);

}  // namespace

absl::StatusOr<std::unique_ptr<RampHolder>> RampHolder::hold(const Client& client, const std::string& monitor,
                                                             const std::string& camera) {
  std::unique_ptr<RampHolder> holder(new RampHolder(client));
  holder->stream_ = holder->server_.stub->ShowRamp(&holder->context_);
  holder->request_.set_monitor(monitor);
  holder->request_.set_camera(camera);
  const Interruptible ctrl_c([&holder] { holder->context_.TryCancel(); });
  const Waiting waiting("showing the ramp");
  absl::StatusOr<v1::ShowRampResponse> shown = holder->ask();
  if (interrupted()) return absl::CancelledError("the rig is free again");
  GW_ASSIGN_OR_RETURN(holder->shown_, std::move(shown));
  return holder;
}

RampHolder::~RampHolder() {
  asking_ = {};
  context_.TryCancel();
}

absl::StatusOr<v1::ShowRampResponse> RampHolder::ask() {
  v1::ShowRampResponse response;
  if (stream_->Write(request_) && stream_->Read(&response)) return response;
  const grpc::Status status = stream_->Finish();
  if (status.ok()) return absl::UnavailableError(server_.title + " stopped showing the ramp");
  return status_from(status, server_.title);
}

absl::Status RampHolder::bring_object(std::function<void()> lost) {
  request_.set_object(true);
  GW_ASSIGN_OR_RETURN(shown_, ask());
  asking_ = std::jthread([this, lost = std::move(lost)](std::stop_token stop) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any never;
    while (!never.wait_for(lock, stop, kBetweenQuestions, [&] { return stop.stop_requested(); })) {
      const absl::Status asked = ask().status();
      if (asked.ok()) continue;
      {
        const std::lock_guard guard(mutex_);
        status_ = asked;
      }
      return lost();
    }
  });
  return absl::OkStatus();
}

absl::Status RampHolder::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace glasswing
