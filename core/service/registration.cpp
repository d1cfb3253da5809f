#include "core/service/registration.h"

#include <spdlog/spdlog.h>

#include <chrono>

#include "core/base/version.h"
#include "core/service/message_limits.h"
#include "core/service/node_health.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kUsualPause(1000), kPreparingPause(200);

}  // namespace

Registration::Registration(const std::string& server_address, v1::RegisterRequest node,
                           std::filesystem::path data, Update update)
    : server_address_(server_address),
      node_(std::move(node)),
      data_(std::move(data)),
      update_(std::move(update)) {
  if (server_address.empty()) return;
  node_.set_version(kVersion);
  stub_ = v1::NodeService::NewStub(dial(server_address, only(Role::kServer)));
  thread_ = std::jthread([this](std::stop_token stop) { run(stop); });
}

Registration::~Registration() = default;

grpc::Status Registration::call(std::stop_token stop, bool wait_for_ready) {
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(2));
  context.set_wait_for_ready(wait_for_ready);
  const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
  v1::RegisterResponse response;
  return stub_->Register(&context, node_, &response);
}

void Registration::run(std::stop_token stop) {
  bool known = true;  // so that the first failure is logged
  while (!stop.stop_requested()) {
    *node_.mutable_health() = node_health(data_);
    node_.clear_preparation();
    if (update_) update_(node_);
    node_.set_detail(fitted(node_.detail()));
    grpc::Status status = call(stop, true);  // returns as soon as the server is up
    // A call that waits reports only its deadline; one that does not reports why the server is unreachable.
    if (!status.ok() && known) status = call(stop, false);
    if (stop.stop_requested()) return;
    if (status.ok() != known) {
      known = status.ok();
      if (known) {
        spdlog::info("the server knows this node node={}", node_.name());
      } else {
        const absl::Status why = from_grpc(status, "the server at " + server_address_);
        spdlog::warn("the server does not take this node yet, retrying: {}", std::string(why.message()));
      }
    }
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, node_.has_preparation() ? kPreparingPause : kUsualPause, [] { return false; });
  }
}

}  // namespace glasswing
