// Streams a camera that is reserved for this call and keeps its newest frame.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/camera_service.grpc.pb.h"

namespace glasswing {

struct StreamedFrame {
  v1::FrameTaken taken;  // times by the camera node's clock
  std::shared_ptr<const std::vector<std::uint16_t>> samples;
  nanoseconds came{};  // when it was complete, by this machine's clock
};

class CameraStream {
 public:
  CameraStream(const std::string& address, double exposure_ms);
  ~CameraStream();  // releases the camera

  absl::StatusOr<v1::Camera> describe();
  // The newest frame that was not returned yet; none after `timeout`. UNAVAILABLE: the camera is gone.
  absl::StatusOr<std::optional<StreamedFrame>> newest(std::chrono::milliseconds timeout);

 private:
  void read();

  const std::string title_;
  std::unique_ptr<v1::CameraService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::StreamFramesResponse>> reader_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<StreamedFrame> newest_;  // guarded by mutex_
  std::optional<absl::Status> end_;      // guarded by mutex_
  std::thread thread_;
};

}  // namespace glasswing
