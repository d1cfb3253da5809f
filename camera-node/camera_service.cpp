#include "camera-node/camera_service.h"

#include <algorithm>

#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr int kRingFrames = 600;
constexpr size_t kRingBytes = size_t{1} << 30;
constexpr std::chrono::seconds kSilence(3);  // without a frame, beyond what the frame rate explains
constexpr int kMaxBatch = 4096;

}  // namespace

grpc::Status CameraServiceImpl::GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*,
                                          v1::GetCameraResponse* response) {
  *response = camera_.describe();
  response->set_ring_frames(kRingFrames);
  return grpc::Status::OK;
}

grpc::Status CameraServiceImpl::Capture(grpc::ServerContext* context, const v1::CaptureRequest* request,
                                        grpc::ServerWriter<v1::CaptureResponse>* writer) {
  // A call that was just cancelled needs a moment to let go.
  const std::unique_lock only(capturing_, std::chrono::seconds(1));
  if (!only.owns_lock()) {
    return to_grpc(absl::FailedPreconditionError(
        "the camera is capturing for somebody else; try again when it is free"));
  }
  if (const absl::Status status = camera_.start(request->exposure_ms()); !status.ok()) return to_grpc(status);
  writer->Write(v1::CaptureResponse());
  const double rate_hz = camera_.describe().frame_rate_hz();
  const nanoseconds silence = kSilence + nanoseconds(static_cast<std::int64_t>(2e9 / rate_hz));
  nanoseconds heard = monotonic_now();
  while (!context->IsCancelled() && !stopping_) {
    std::optional<CapturedFrame> frame = camera_.next(std::chrono::milliseconds(200));
    if (!frame && monotonic_now() - heard < silence) continue;
    if (!frame) {
      camera_.stop();
      return to_grpc(absl::UnavailableError("the camera has stopped giving frames; is it still plugged in?"));
    }
    heard = monotonic_now();
    v1::CaptureResponse response;
    *response.mutable_frame() = frame->taken;
    {
      const std::lock_guard lock(mutex_);
      ring_bytes_ += frame->held_bytes;
      ring_.push_back(*std::move(frame));
      while (ring_.size() > kRingFrames || (ring_bytes_ > kRingBytes && ring_.size() > 1)) {
        ring_bytes_ -= ring_.front().held_bytes;
        ring_.pop_front();
      }
    }
    if (!writer->Write(response)) break;
  }
  camera_.stop();
  return grpc::Status::OK;
}

grpc::Status CameraServiceImpl::KeepFrames(grpc::ServerContext*, const v1::KeepFramesRequest* request,
                                           v1::KeepFramesResponse* response) {
  if (request->frames_size() > kMaxBatch) {
    return to_grpc(absl::InvalidArgumentError("more than 4096 frames are asked for at once"));
  }
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  std::vector<Archive::NewFrame> batch;
  for (const v1::Frame& wanted : request->frames()) {
    if (wanted.step() < 0 || !wanted.file().empty()) {
      return to_grpc(absl::InvalidArgumentError("a frame to keep needs a step of 0 or more, and no file"));
    }
    std::function<absl::StatusOr<Image16>()> image_of;
    {
      const std::lock_guard lock(mutex_);
      const auto found = std::find_if(ring_.begin(), ring_.end(), [&](const CapturedFrame& frame) {
        return frame.taken.sequence() == wanted.sequence();
      });
      if (found == ring_.end()) continue;
      image_of = found->image;
    }
    absl::StatusOr<Image16> image = image_of();
    if (!image.ok()) return to_grpc(image.status());
    batch.push_back({.record = wanted, .image = *std::move(image)});
  }
  const absl::StatusOr<std::vector<v1::Frame>> stored = (*archive)->add(batch);
  if (!stored.ok()) return to_grpc(stored.status());
  for (const v1::Frame& frame : *stored) *response->add_frames() = frame;
  return grpc::Status::OK;
}

}  // namespace glasswing
