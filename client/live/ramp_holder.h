// The rig with the ramp on one monitor, held for as long as this lives (RigService.ShowRamp).
#pragma once

#include <absl/status/statusor.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "client/cli/client.h"
#include "client/cli/rpc.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {

class RampHolder {
 public:
  // Returns when the ramp is there and the object is not.
  static absl::StatusOr<std::unique_ptr<RampHolder>> hold(const Client& client, const std::string& monitor);
  ~RampHolder();  // the rig is free again

  const v1::ShowRampResponse& shown() const { return shown_; }
  // Then asks again and again whether the ramp is still there; `lost` is called once when it is not, or when
  // the server is gone.
  absl::Status bring_object(std::function<void()> lost);
  // OK as long as all is well.
  absl::Status status() const;

 private:
  explicit RampHolder(const Client& client) : server_(client.server_title(), client.server) {}
  absl::StatusOr<v1::ShowRampResponse> ask();

  const Peer<v1::RigService> server_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ShowRampRequest, v1::ShowRampResponse>> stream_;
  v1::ShowRampRequest request_;
  v1::ShowRampResponse shown_;
  mutable std::mutex mutex_;
  absl::Status status_;  // guarded by mutex_
  std::jthread asking_;
};

}  // namespace glasswing
