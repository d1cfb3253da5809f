// CameraService: the running camera, the ring of its newest frames, and the spool.
#pragma once

#include <atomic>
#include <deque>
#include <mutex>
#include <stop_token>

#include "camera-node/archive_store.h"
#include "camera-node/camera.h"
#include "glasswing/v1/camera_service.grpc.pb.h"

namespace glasswing {

class CameraServiceImpl final : public v1::CameraService::Service {
 public:
  CameraServiceImpl(Camera& camera, ArchiveStore& store) : camera_(camera), store_(store) {}
  // Ends a running capture, so that the daemon can stop.
  void stop() { stopping_ = true; }

  grpc::Status GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*, v1::GetCameraResponse*) override;
  grpc::Status Capture(grpc::ServerContext*, const v1::CaptureRequest*,
                       grpc::ServerWriter<v1::CaptureResponse>*) override;
  grpc::Status KeepFrames(grpc::ServerContext*, const v1::KeepFramesRequest*,
                          v1::KeepFramesResponse*) override;

 private:
  Camera& camera_;
  ArchiveStore& store_;
  std::atomic<bool> stopping_ = false;
  std::timed_mutex capturing_;  // held by the one Capture call
  std::mutex mutex_;
  std::deque<CapturedFrame> ring_;  // guarded by mutex_
  size_t ring_bytes_ = 0;           // that ring_ holds; guarded by mutex_
};

}  // namespace glasswing
