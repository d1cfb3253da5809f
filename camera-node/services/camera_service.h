// CameraService: runs the camera, keeps its newest frames in a ring, and lets a FrameKeeper store the proven
// ones.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>

#include "camera-node/camera.h"
#include "camera-node/services/camera_turns.h"
#include "camera-node/services/frame_comparison.h"
#include "camera-node/services/frame_keeper.h"
#include "camera-node/services/frame_ring.h"
#include "core/archive/archive_store.h"
#include "core/service/joined_calls.h"
#include "glasswing/v1/camera_service.grpc.pb.h"

namespace glasswing {

class CameraServiceImpl final : public v1::CameraService::Service {
 public:
  CameraServiceImpl(Camera& camera, ArchiveStore& store)
      : camera_(camera), keeper_(store, ring_), comparison_(store, ring_) {}
  // Ends running calls, so that the daemon can stop.
  void stop() { stopping_ = true; }

  grpc::Status GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*, v1::GetCameraResponse*) override;
  grpc::Status Capture(grpc::ServerContext*, const v1::CaptureRequest*,
                       grpc::ServerWriter<v1::CaptureResponse>*) override;
  grpc::Status TakePicture(grpc::ServerContext*, const v1::TakePictureRequest*,
                           v1::TakePictureResponse*) override;
  grpc::Status Expose(grpc::ServerContext*, const v1::ExposeRequest*, v1::ExposeResponse*) override;
  grpc::Status KeepFrames(grpc::ServerContext*, const v1::KeepFramesRequest*,
                          v1::KeepFramesResponse*) override;
  grpc::Status LearnPatches(grpc::ServerContext*, const v1::LearnPatchesRequest*,
                            v1::LearnPatchesResponse*) override;
  grpc::Status LookForPatches(grpc::ServerContext*, const v1::LookForPatchesRequest*,
                              v1::LookForPatchesResponse*) override;
  grpc::Status MeasureLight(grpc::ServerContext*, const v1::MeasureLightRequest*,
                            v1::MeasureLightResponse*) override;
  grpc::Status CompareFrames(grpc::ServerContext*, const v1::CompareFramesRequest*,
                             v1::CompareFramesResponse*) override;
  grpc::Status Preview(grpc::ServerContext*, const v1::PreviewRequest*,
                       grpc::ServerWriter<v1::PreviewResponse>*) override;
  grpc::Status StreamFrames(grpc::ServerContext*, const v1::StreamFramesRequest*,
                            grpc::ServerWriter<v1::StreamFramesResponse>*) override;

 private:
  // False: another Preview call is running.
  bool take_preview(const grpc::ServerContext& context);
  using Take = std::function<bool(const v1::FrameTaken*)>;
  // Sends the camera's preparation until it is ready. False: the call is over.
  template <typename Response>
  bool wait_prepared(const std::function<bool()>& is_over, grpc::ServerWriter<Response>& writer);
  // Runs the camera for one call, once it is prepared, until its turn ends or `take` returns false. Calls
  // `take` with null once the camera is running, then with each frame. The newest `keep` frames stay in the
  // ring.
  template <typename Response>
  absl::Status run(CameraCall& call, grpc::ServerWriter<Response>& writer, size_t keep, const Take& take);
  absl::Status run_started(const CameraCall& call, size_t keep, const Take& take);

  Camera& camera_;
  FrameRing ring_;
  FrameKeeper keeper_;
  FrameComparison comparison_;
  std::atomic<bool> stopping_ = false;
  std::atomic<nanoseconds> triggered_at_ = nanoseconds(0);  // first trigger since the last frame; 0: none
  // For Capture and StreamFrames calls, and for a Preview while none of these needs the camera.
  CameraTurns turns_;
  JoinedCalls<v1::TakePictureResponse> pictures_;
  JoinedCalls<v1::KeepFramesResponse> keeps_;
  JoinedCalls<v1::LearnPatchesResponse> learnings_;
  std::mutex preview_mutex_;
  const grpc::ServerContext* preview_ = nullptr;  // the one Preview call; guarded by preview_mutex_
};

}  // namespace glasswing
