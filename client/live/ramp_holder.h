// Holds the rig with the ramp on one monitor until destroyed (RigService.ShowRamp).
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
  // Returns once the ramp is shown and the stage is empty.
  static absl::StatusOr<std::unique_ptr<RampHolder>> hold(const Client& client, const std::string& monitor,
                                                          const std::string& camera);
  ~RampHolder();  // frees the rig

  const v1::ShowRampResponse& shown() const { return shown_; }
  // Requests the object, then polls whether the ramp is still shown; calls `lost` once if it is not or the
  // server is unreachable.
  absl::Status bring_object(std::function<void()> lost);
  // OK until the ramp is lost.
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
