// Converts a camera node's clock to this program's; a thread keeps the estimate up to date.
#pragma once

#include <absl/status/statusor.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "client/cli/rpc.h"
#include "core/timing/clock_model.h"
#include "glasswing/v1/clock_service.grpc.pb.h"

namespace glasswing {

class CameraClock {
 public:
  // Returns after the first exchanges.
  static absl::StatusOr<std::unique_ptr<CameraClock>> follow(const std::string& camera_address);
  // This program's CLOCK_MONOTONIC at this time of the camera's clock.
  ClockReading local(nanoseconds camera_time) const;

 private:
  explicit CameraClock(const std::string& address) : camera_("camera node at " + address, address) {}
  absl::Status exchange();

  const Peer<v1::ClockService> camera_;
  mutable std::mutex mutex_;
  ClockModel clock_;  // guarded by mutex_
  std::jthread thread_;
};

}  // namespace glasswing
