// CameraService: the running camera, the ring of its newest frames, and the spool.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>

#include "camera-node/camera.h"
#include "camera-node/services/patch_proof.h"
#include "core/archive/archive_store.h"
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
  grpc::Status LookForPatches(grpc::ServerContext*, const v1::LookForPatchesRequest*,
                              v1::LookForPatchesResponse*) override;
  grpc::Status MeasureLight(grpc::ServerContext*, const v1::MeasureLightRequest*,
                            v1::MeasureLightResponse*) override;
  grpc::Status Preview(grpc::ServerContext*, const v1::PreviewRequest*,
                       grpc::ServerWriter<v1::PreviewResponse>*) override;
  grpc::Status StreamFrames(grpc::ServerContext*, const v1::StreamFramesRequest*,
                            grpc::ServerWriter<v1::StreamFramesResponse>*) override;

 private:
  // Runs the camera for one call, until it is cancelled or `take` has had enough: it is called without a
  // frame when the camera runs, and then with each. `keep` of the newest frames stay in the ring.
  absl::Status run(grpc::ServerContext& context, double exposure_ms, size_t keep,
                   const std::function<bool(const v1::FrameTaken*)>& take);
  // The newest frame, once it is another one than `sequence`; none after `timeout`.
  std::optional<CapturedFrame> newer_than(std::int64_t sequence, std::chrono::milliseconds timeout);
  std::optional<CapturedFrame> in_ring(std::int64_t sequence);
  // The asked-for frames that are still in the ring.
  using Frames = google::protobuf::RepeatedPtrField<v1::Frame>;
  absl::StatusOr<std::vector<Archive::NewFrame>> find(const Frames& frames);
  // Takes out what its pixels do not prove, and says so in the response.
  absl::Status check_patches(const v1::KeepFramesRequest& request, Archive& archive,
                             std::vector<Archive::NewFrame>& batch, v1::KeepFramesResponse& response);

  Camera& camera_;
  ArchiveStore& store_;
  std::atomic<bool> stopping_ = false;
  // Held by the one Capture or StreamFrames call, or by a Preview while none of them wants it.
  std::timed_mutex capturing_;
  std::atomic<int> captures_waiting_ = 0;
  std::mutex previewing_;  // held by the one Preview call
  std::mutex mutex_;
  std::condition_variable frame_came_;
  std::deque<CapturedFrame> ring_;  // guarded by mutex_
  size_t ring_bytes_ = 0;           // that ring_ holds; guarded by mutex_
  std::mutex keeping_;              // held while frames are judged and written
  std::string proof_session_;       // guarded by keeping_: whose patches proof_ knows
  PatchProof proof_;                // guarded by keeping_
};

}  // namespace glasswing
