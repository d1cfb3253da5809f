#include "camera-node/services/camera_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <thread>

#include "camera-node/camera_metrics.h"
#include "camera-node/services/preview.h"
#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr int kRingFrames = 600;
constexpr size_t kRingBytes = size_t{1} << 30;
constexpr std::chrono::seconds kSilence(3);  // without a frame, beyond what the frame rate explains
constexpr int kMaxBatch = 4096;
constexpr double kPreviewExposureMs = 4.0;
constexpr std::chrono::milliseconds kPreviewPause(20);  // how soon it notices that somebody wants to capture

// The sample of the sensor's highest code, scaled to 16 bits.
std::uint16_t full_scale_of(const v1::Camera& camera) {
  const int bits = std::clamp(camera.bits(), 1, 16);
  return static_cast<std::uint16_t>(65535 - (65535 >> bits));
}

absl::Status check_preview(const v1::PreviewRequest& request) {
  if (!(request.max_fps() >= 0.2 && request.max_fps() <= 10.0))
    return absl::InvalidArgumentError(fmt::format("max_fps is {}; it must be 0.2 to 10", request.max_fps()));
  if (request.max_width_px() < 16 || request.max_width_px() > 4096) {
    return absl::InvalidArgumentError(
        fmt::format("max_width_px is {}; it must be 16 to 4096", request.max_width_px()));
  }
  return absl::OkStatus();
}

bool write_whole(const Image16& image, const v1::FrameTaken& taken,
                 grpc::ServerWriter<v1::StreamFramesResponse>& writer) {
  const char* const bytes = reinterpret_cast<const char*>(image.samples.data());
  const size_t size = image.samples.size() * sizeof(std::uint16_t);
  v1::StreamFramesResponse response;
  *response.mutable_frame() = taken;
  bool written = true;
  for (size_t at = 0; written && at < size; at += kChunkBytes) {
    response.set_chunk(bytes + at, std::min(kChunkBytes, size - at));
    written = writer.Write(response);
    response.clear_frame();
  }
  return written;
}

bool is_lesson(const Archive::NewFrame& frame) {
  return kind_of(frame.record.stimulus()) == StimulusKind::kPatch;
}

// On disk. Frames of a video may use the reserve: it cannot be gone on with later.
std::int64_t bytes_of(const std::vector<Archive::NewFrame>& batch) {
  size_t bytes = 0;
  for (const Archive::NewFrame& frame : batch) {
    const bool of_video = frame.record.object() && kind_of(frame.record.stimulus()) == StimulusKind::kRamp;
    if (!of_video) bytes += tiff_size_bytes(frame.image.width_px, frame.image.height_px);
  }
  return static_cast<std::int64_t>(bytes);
}

v1::UnseenPatch unseen_patch(const PatchProof::Lessons& lessons) {
  v1::UnseenPatch patch;
  patch.set_monitor(lessons.frames.front().record.stimulus().panel());
  patch.set_reason(std::string(lessons.learned.message()));
  patch.set_dark(absl::IsNotFound(lessons.learned));
  return patch;
}

}  // namespace

grpc::Status CameraServiceImpl::GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*,
                                          v1::GetCameraResponse* response) {
  *response = camera_.describe();
  response->set_ring_frames(kRingFrames);
  return grpc::Status::OK;
}

absl::Status CameraServiceImpl::run(grpc::ServerContext& context, double exposure_ms, size_t keep,
                                    const std::function<bool(const v1::FrameTaken*)>& take) {
  // A preview, or a call that was just cancelled, needs a moment to let go.
  ++captures_waiting_;
  const std::unique_lock only(capturing_, std::chrono::seconds(1));
  --captures_waiting_;
  if (!only.owns_lock()) {
    return absl::FailedPreconditionError(
        "the camera is capturing for somebody else; try again when it is free");
  }
  GW_RETURN_IF_ERROR(camera_.start(exposure_ms));
  const double rate_hz = camera_.describe().frame_rate_hz();
  const nanoseconds silence = kSilence + nanoseconds(static_cast<std::int64_t>(2e9 / rate_hz));
  nanoseconds heard = monotonic_now();
  bool wanted = take(nullptr);
  while (wanted && !context.IsCancelled() && !stopping_) {
    std::optional<CapturedFrame> frame = camera_.next(std::chrono::milliseconds(200));
    if (!frame && monotonic_now() - heard < silence) continue;
    if (!frame) {
      camera_.stop();
      return absl::UnavailableError("the camera has stopped giving frames; is it still plugged in?");
    }
    heard = monotonic_now();
    camera_metrics().frames.Increment();
    const v1::FrameTaken taken = frame->taken;
    {
      const std::lock_guard lock(mutex_);
      ring_bytes_ += frame->held_bytes;
      ring_.push_back(*std::move(frame));
      while (ring_.size() > keep || (ring_bytes_ > kRingBytes && ring_.size() > 1)) {
        ring_bytes_ -= ring_.front().held_bytes;
        ring_.pop_front();
      }
    }
    frame_came_.notify_all();
    wanted = take(&taken);
  }
  camera_.stop();
  return absl::OkStatus();
}

grpc::Status CameraServiceImpl::Capture(grpc::ServerContext* context, const v1::CaptureRequest* request,
                                        grpc::ServerWriter<v1::CaptureResponse>* writer) {
  return to_grpc(run(*context, request->exposure_ms(), kRingFrames, [&](const v1::FrameTaken* taken) {
    v1::CaptureResponse response;
    if (taken != nullptr) *response.mutable_frame() = *taken;
    return writer->Write(response);
  }));
}

grpc::Status CameraServiceImpl::StreamFrames(grpc::ServerContext* context,
                                             const v1::StreamFramesRequest* request,
                                             grpc::ServerWriter<v1::StreamFramesResponse>* writer) {
  std::atomic<bool> wanted = true;
  std::jthread sender;  // converts and sends, while the camera goes on
  const auto send = [&](std::stop_token stop) {
    std::int64_t sent = -1;
    while (wanted && !stop.stop_requested()) {
      const std::optional<CapturedFrame> frame = newer_than(sent, std::chrono::milliseconds(50));
      if (!frame) continue;
      sent = frame->taken.sequence();
      const absl::StatusOr<Image16> image = frame->image();
      if (!image.ok()) continue;  // the next one may be whole
      wanted = write_whole(*image, frame->taken, *writer);
    }
  };
  const auto take = [&](const v1::FrameTaken* taken) {
    if (taken == nullptr) {
      wanted = writer->Write(v1::StreamFramesResponse());
      const std::lock_guard lock(mutex_);
      ring_.clear();  // what another call left
      ring_bytes_ = 0;
      sender = std::jthread(send);
    }
    return wanted.load();
  };
  return to_grpc(run(*context, request->exposure_ms(), 1, take));
}

grpc::Status CameraServiceImpl::KeepFrames(grpc::ServerContext*, const v1::KeepFramesRequest* request,
                                           v1::KeepFramesResponse* response) {
  if (request->frames_size() > kMaxBatch) {
    return to_grpc(absl::InvalidArgumentError("more than 4096 frames are asked for at once"));
  }
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  absl::StatusOr<std::vector<Archive::NewFrame>> batch = find(request->frames());
  if (!batch.ok()) return to_grpc(batch.status());
  const std::lock_guard lock(keeping_);
  if (const absl::Status status = check_patches(*request, **archive, *batch, *response); !status.ok())
    return to_grpc(status);
  if (const absl::Status status = store_.room().check(bytes_of(*batch)); !status.ok()) return to_grpc(status);
  const absl::StatusOr<std::vector<v1::Frame>> stored = (*archive)->add(*batch);
  if (!stored.ok()) return to_grpc(stored.status());
  for (const v1::Frame& frame : *stored) *response->add_frames() = frame;
  camera_metrics().kept.Increment(static_cast<double>(stored->size()));
  camera_metrics().refused.Increment(response->refused());
  return grpc::Status::OK;
}

std::optional<CapturedFrame> CameraServiceImpl::newer_than(std::int64_t sequence,
                                                           std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  const auto is_there = [&] { return !ring_.empty() && ring_.back().taken.sequence() != sequence; };
  return frame_came_.wait_for(lock, timeout, is_there) ? std::optional(ring_.back()) : std::nullopt;
}

std::optional<CapturedFrame> CameraServiceImpl::in_ring(std::int64_t sequence) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(ring_.begin(), ring_.end(), [&](const CapturedFrame& frame) {
    return frame.taken.sequence() == sequence;
  });
  return found == ring_.end() ? std::nullopt : std::optional(*found);
}

absl::StatusOr<std::vector<Archive::NewFrame>> CameraServiceImpl::find(const Frames& frames) {
  std::vector<Archive::NewFrame> batch;
  for (const v1::Frame& wanted : frames) {
    if (wanted.step() < 0 || !wanted.file().empty())
      return absl::InvalidArgumentError("a frame to keep needs a step of 0 or more, and no file");
    const std::optional<CapturedFrame> found = in_ring(wanted.sequence());
    if (!found) continue;
    GW_ASSIGN_OR_RETURN(Image16 image, found->image());
    batch.push_back({.record = wanted, .image = std::move(image)});
    batch.back().record.set_proof(v1::PROOF_TIME);
  }
  return batch;
}

absl::Status CameraServiceImpl::check_patches(const v1::KeepFramesRequest& request, Archive& archive,
                                              std::vector<Archive::NewFrame>& batch,
                                              v1::KeepFramesResponse& response) {
  if (proof_session_ != request.session()) {
    proof_ = {};
    GW_RETURN_IF_ERROR(proof_.learn_from(archive));
    proof_session_ = request.session();
  }
  const auto accepted = [&](const std::string& monitor) {
    const auto& list = request.accept_unseen_patches();
    return std::find(list.begin(), list.end(), monitor) != list.end();
  };
  std::vector<Archive::NewFrame> proven;
  std::set<int> waiting;
  const auto others = std::stable_partition(batch.begin(), batch.end(), is_lesson);
  for (auto frame = batch.begin(); frame != others; ++frame) {
    waiting.insert(frame->record.step());
    std::optional<PatchProof::Lessons> lessons = proof_.add(std::move(*frame));
    if (!lessons) continue;
    if (!lessons->learned.ok()) *response.add_unseen_patches() = unseen_patch(*lessons);
    for (Archive::NewFrame& lesson : lessons->frames) {
      waiting.erase(lesson.record.step());
      // What taught every cell was itself what it should be.
      if (lessons->learned.ok()) lesson.record.set_proof(v1::PROOF_TIME_AND_PATCH);
      if (lessons->learned.ok() || accepted(lesson.record.stimulus().panel()))
        proven.push_back(std::move(lesson));
    }
  }
  for (const int step : waiting) response.add_waiting_steps(step);
  for (auto frame = others; frame != batch.end(); ++frame) {
    if (proof_.agrees(frame->record, frame->image)) {
      proven.push_back(std::move(*frame));
    } else {
      response.set_refused(response.refused() + 1);
    }
  }
  batch = std::move(proven);
  return absl::OkStatus();
}

grpc::Status CameraServiceImpl::LookForPatches(grpc::ServerContext*, const v1::LookForPatchesRequest* request,
                                               v1::LookForPatchesResponse* response) {
  if (request->frames_size() > kMaxBatch)
    return to_grpc(absl::InvalidArgumentError("more than 4096 frames are asked for at once"));
  absl::StatusOr<std::vector<Archive::NewFrame>> batch = find(request->frames());
  if (!batch.ok()) return to_grpc(batch.status());
  PatchProof proof;
  std::map<std::string, v1::UnseenPatch> unseen;
  for (const v1::Frame& frame : request->frames()) {
    v1::UnseenPatch& patch = unseen[frame.stimulus().panel()];
    patch.set_monitor(frame.stimulus().panel());
    patch.set_reason("not all frames of its id patch are still with the camera");
  }
  for (Archive::NewFrame& frame : *batch) {
    const std::optional<PatchProof::Lessons> lessons = proof.add(std::move(frame));
    if (!lessons) continue;
    const std::string& monitor = lessons->frames.front().record.stimulus().panel();
    if (lessons->learned.ok()) {
      unseen.erase(monitor);
    } else {
      unseen[monitor] = unseen_patch(*lessons);
    }
  }
  for (auto& [monitor, patch] : unseen) *response->add_unseen_patches() = std::move(patch);
  return grpc::Status::OK;
}

grpc::Status CameraServiceImpl::MeasureLight(grpc::ServerContext*, const v1::MeasureLightRequest* request,
                                             v1::MeasureLightResponse* response) {
  if (request->sequences_size() > kMaxBatch)
    return to_grpc(absl::InvalidArgumentError("more than 4096 frames are asked for at once"));
  const absl::StatusOr<FrameLight> light = request->has_calibration()
                                               ? FrameLight::create(request->calibration())
                                               : FrameLight::create(v1::CaptureManifest());
  if (!light.ok()) return to_grpc(light.status());
  const std::uint16_t full_scale = full_scale_of(camera_.describe().camera());
  for (const std::int64_t sequence : request->sequences()) {
    const std::optional<CapturedFrame> found = in_ring(sequence);
    if (!found) continue;
    const absl::StatusOr<Image16> image = found->image();
    if (!image.ok()) return to_grpc(image.status());
    *response->add_frames() = light_of(*image, *light, full_scale);
    response->mutable_frames()->rbegin()->set_sequence(sequence);
  }
  return grpc::Status::OK;
}

grpc::Status CameraServiceImpl::Preview(grpc::ServerContext* context, const v1::PreviewRequest* request,
                                        grpc::ServerWriter<v1::PreviewResponse>* writer) {
  if (const absl::Status status = check_preview(*request); !status.ok()) return to_grpc(status);
  const std::unique_lock only(previewing_, std::try_to_lock);
  if (!only.owns_lock())
    return to_grpc(absl::FailedPreconditionError("another preview runs; one at a time is served"));
  const v1::GetCameraResponse camera = camera_.describe();
  const double exposure_ms =
      request->exposure_ms() != 0.0
          ? request->exposure_ms()
          : std::clamp(kPreviewExposureMs, camera.min_exposure_ms(), camera.max_exposure_ms());
  const nanoseconds period(static_cast<std::int64_t>(1e9 / request->max_fps()));
  nanoseconds due = monotonic_now();
  std::int64_t shown = -1;
  std::unique_lock running(capturing_, std::defer_lock);  // held while the camera runs for this call
  const auto give_up = [&] {
    if (!running.owns_lock()) return;
    camera_.stop();
    running.unlock();
  };
  while (!context->IsCancelled() && !stopping_) {
    if (captures_waiting_ > 0) give_up();
    if (!running.owns_lock() && captures_waiting_ == 0 && running.try_lock()) {
      if (const absl::Status status = camera_.start(exposure_ms); !status.ok()) return to_grpc(status);
    }
    std::optional<CapturedFrame> frame;
    if (running.owns_lock()) {
      frame = camera_.next(kPreviewPause);
    } else {
      std::this_thread::sleep_for(kPreviewPause);
      const std::lock_guard lock(mutex_);
      if (!ring_.empty()) frame = ring_.back();
    }
    if (!frame || frame->taken.sequence() == shown || monotonic_now() < due) continue;
    shown = frame->taken.sequence();
    due = std::max(due + period, monotonic_now());
    const absl::StatusOr<Image16> image = frame->image();
    if (!image.ok()) continue;  // the next one may be whole
    v1::PreviewResponse response =
        preview_of(*image, request->max_width_px(), full_scale_of(camera.camera()));
    response.set_exposure_ms(frame->taken.exposure_ms());
    if (!writer->Write(response)) break;
  }
  give_up();
  return grpc::Status::OK;
}

}  // namespace glasswing
