#include "camera-node/services/camera_service.h"

#include <absl/cleanup/cleanup.h>
#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "camera-node/camera_metrics.h"
#include "camera-node/services/preview.h"
#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr int kRingFrames = 600;
constexpr std::chrono::seconds kMaxSilence(3);  // without a frame, on top of two frame periods
constexpr int kMaxSequences = 4096;
constexpr std::chrono::seconds kMaxTriggerLead(1);
constexpr std::chrono::seconds kPreviewEnds(5);
constexpr double kPreviewExposureMs = 4.0;
constexpr std::chrono::milliseconds kPreviewPause(20);  // how often a preview looks for a waiting capture
constexpr std::chrono::seconds kAskPause(1);            // between responses while no picture has arrived
constexpr std::chrono::milliseconds kPreparationPause(
    200);  // between responses while the camera is preparing

// The sensor's highest code, scaled to 16 bits.
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

// What an on-demand camera is waiting for.
std::string due_text(const v1::GetCameraResponse& camera) {
  if (!camera.has_due()) return "waiting for a picture in the folder; press the camera's button";
  return fmt::format("the folder has waited {:.0f} s for {}",
                     1e-9 * static_cast<double>(camera.due().waited_ns()), camera.due().what());
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

constexpr char kTakenOver[] = "a later call has taken over the camera";

}  // namespace

grpc::Status CameraServiceImpl::GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*,
                                          v1::GetCameraResponse* response) {
  *response = camera_.describe();
  const FrameShape shape = shape_of(response->camera());
  const size_t frame_bytes = 2 * shape.row_samples() * static_cast<size_t>(shape.height_px);
  const size_t fit = frame_bytes > 0 ? FrameRing::kMaxHeld_bytes / frame_bytes : 0;
  response->set_ring_frames(static_cast<int>(std::clamp<size_t>(fit, 1, kRingFrames)));
  return grpc::Status::OK;
}

template <typename Response>
bool CameraServiceImpl::wait_prepared(const std::function<bool()>& is_over,
                                      grpc::ServerWriter<Response>& writer) {
  while (!is_over()) {
    v1::GetCameraResponse camera = camera_.describe();
    if (!camera.has_preparation()) return true;
    Response response;
    *response.mutable_preparation() = std::move(*camera.mutable_preparation());
    if (!writer.Write(response)) return false;
    std::this_thread::sleep_for(kPreparationPause);
  }
  return false;
}

template <typename Response>
absl::Status CameraServiceImpl::run(CameraCall& call, grpc::ServerWriter<Response>& writer, size_t keep,
                                    const Take& take) {
  GW_RETURN_IF_ERROR(turns_.take(call));
  absl::Status status;
  if (!call.started) {
    if (!wait_prepared([&] { return call.replaced || call.is_gone(); }, writer)) {
      turns_.end(call);
      return call.replaced ? absl::AbortedError(kTakenOver) : absl::OkStatus();
    }
    fault_point("camera starts");
    status = call.triggered ? camera_.start_triggered(call.exposure_ms) : camera_.start(call.exposure_ms);
  }
  if (status.ok()) status = run_started(call, keep, take);
  if (status.ok() && turns_.hand_over(call)) return absl::AbortedError(kTakenOver);
  camera_.stop();
  turns_.end(call);
  return status;
}

absl::Status CameraServiceImpl::run_started(const CameraCall& call, size_t keep, const Take& take) {
  const v1::GetCameraResponse camera = camera_.describe();
  const nanoseconds silence =
      camera.on_demand() ? nanoseconds::max()
                         : kMaxSilence + nanoseconds(static_cast<std::int64_t>(2e9 / camera.frame_rate_hz()));
  nanoseconds heard = monotonic_now();
  triggered_at_ = nanoseconds(0);
  bool wanted = take(nullptr);
  while (wanted && !call.replaced && !call.is_gone()) {
    std::optional<CapturedFrame> frame = camera_.next(std::chrono::milliseconds(200));
    if (!frame) {
      const nanoseconds since = call.triggered ? triggered_at_.load() : heard;
      if (since == nanoseconds(0) || monotonic_now() - since < silence) continue;
      return absl::UnavailableError("the camera has stopped delivering frames; is it still plugged in?");
    }
    heard = monotonic_now();
    triggered_at_ = nanoseconds(0);
    camera_metrics().frames.Increment();
    const v1::FrameTaken taken = frame->taken;
    ring_.push(*std::move(frame), keep);
    wanted = take(&taken);
  }
  return absl::OkStatus();
}

grpc::Status CameraServiceImpl::Capture(grpc::ServerContext* context, const v1::CaptureRequest* request,
                                        grpc::ServerWriter<v1::CaptureResponse>* writer) {
  const auto is_gone = [&] { return context->IsCancelled() || stopping_; };
  CameraCall call{.id = request->request_id(),
                  .exposure_ms = request->exposure_ms(),
                  .triggered = request->triggered(),
                  .is_gone = is_gone};
  return to_grpc(run(call, *writer, kRingFrames, [&](const v1::FrameTaken* taken) {
    v1::CaptureResponse response;
    if (taken != nullptr) *response.mutable_frame() = *taken;
    return writer->Write(response);
  }));
}

grpc::Status CameraServiceImpl::TakePicture(grpc::ServerContext* context,
                                            const v1::TakePictureRequest* request,
                                            v1::TakePictureResponse* response) {
  constexpr size_t kMaxWhat_bytes = 200;
  if (request->what().size() > kMaxWhat_bytes) {
    return to_grpc(absl::InvalidArgumentError(
        fmt::format("what has {} bytes; the maximum is {}", request->what().size(), kMaxWhat_bytes)));
  }
  const auto take = [&]() -> absl::StatusOr<v1::TakePictureResponse> {
    GW_RETURN_IF_ERROR(camera_.take_picture(request->what()));
    v1::TakePictureResponse taken;
    *taken.mutable_due() = camera_.describe().due();
    return taken;
  };
  return answer(pictures_.run(*context, request->request_id(), take), *response);
}

grpc::Status CameraServiceImpl::Expose(grpc::ServerContext*, const v1::ExposeRequest* request,
                                       v1::ExposeResponse*) {
  const nanoseconds at(request->at_ns()), now = monotonic_now();
  if (at > now + kMaxTriggerLead) {
    return to_grpc(absl::InvalidArgumentError(fmt::format(
        "at_ns is {} ms ahead; it must be at most {} ms ahead", (at - now) / std::chrono::milliseconds(1),
        kMaxTriggerLead / std::chrono::milliseconds(1))));
  }
  nanoseconds none{};
  triggered_at_.compare_exchange_strong(none, std::max(at, now));
  return to_grpc(camera_.trigger(at));
}

grpc::Status CameraServiceImpl::StreamFrames(grpc::ServerContext* context,
                                             const v1::StreamFramesRequest* request,
                                             grpc::ServerWriter<v1::StreamFramesResponse>* writer) {
  const v1::GetCameraResponse camera = camera_.describe();
  if (camera.on_demand()) {
    return to_grpc(absl::FailedPreconditionError(
        "the camera takes pictures only on request; a live matte needs a stream"));
  }
  const std::optional<Mosaic> mosaic = mosaic_of(camera.camera());
  std::atomic<bool> wanted = true;
  std::jthread sender;  // converts and sends while the camera runs on
  const auto send = [&](std::stop_token stop) {
    std::int64_t sent = -1;
    while (wanted && !stop.stop_requested()) {
      const std::optional<CapturedFrame> frame = ring_.wait_newer(sent, std::chrono::milliseconds(50));
      if (!frame) continue;
      sent = frame->taken.sequence();
      absl::StatusOr<Image16> image = frame->image();
      if (!image.ok()) continue;  // the next frame may be intact
      if (mosaic) image = interpolated(*image, mosaic);
      wanted = write_whole(*image, frame->taken, *writer);
    }
  };
  const auto take = [&](const v1::FrameTaken* taken) {
    if (taken == nullptr) {
      wanted = writer->Write(v1::StreamFramesResponse());
      ring_.clear();  // frames of an earlier call
      sender = std::jthread(send);
    }
    return wanted.load();
  };
  const auto is_gone = [&] { return context->IsCancelled() || stopping_; };
  CameraCall call{.exposure_ms = request->exposure_ms(), .is_gone = is_gone};
  return to_grpc(run(call, *writer, 1, take));
}

grpc::Status CameraServiceImpl::KeepFrames(grpc::ServerContext* context, const v1::KeepFramesRequest* request,
                                           v1::KeepFramesResponse* response) {
  return answer(keeps_.run(*context, request->request_id(), [&] { return keeper_.keep(*request); }),
                *response);
}

grpc::Status CameraServiceImpl::LearnPatches(grpc::ServerContext* context,
                                             const v1::LearnPatchesRequest* request,
                                             v1::LearnPatchesResponse* response) {
  return answer(learnings_.run(*context, request->request_id(), [&] { return keeper_.learn(*request); }),
                *response);
}

grpc::Status CameraServiceImpl::LookForPatches(grpc::ServerContext*, const v1::LookForPatchesRequest* request,
                                               v1::LookForPatchesResponse* response) {
  return answer(keeper_.look(*request), *response);
}

grpc::Status CameraServiceImpl::MeasureLight(grpc::ServerContext*, const v1::MeasureLightRequest* request,
                                             v1::MeasureLightResponse* response) {
  if (request->sequences_size() > kMaxSequences) {
    return to_grpc(
        absl::InvalidArgumentError(fmt::format("{} frames are requested at once; at most {} are allowed",
                                               request->sequences_size(), kMaxSequences)));
  }
  const absl::StatusOr<FrameLight> light = request->has_calibration()
                                               ? FrameLight::create(request->calibration())
                                               : FrameLight::create(v1::CaptureManifest());
  if (!light.ok()) return to_grpc(light.status());
  const v1::Camera camera = camera_.describe().camera();
  const std::optional<Mosaic> mosaic = mosaic_of(camera);
  const std::uint16_t full_scale = full_scale_of(camera);
  for (const std::int64_t sequence : request->sequences()) {
    const std::optional<CapturedFrame> found = ring_.find(sequence);
    if (!found) continue;
    absl::StatusOr<Image16> image = found->image();
    if (!image.ok()) return to_grpc(image.status());
    if (mosaic) image = interpolated(*image, mosaic);
    *response->add_frames() = light_of(*image, *light, full_scale);
    response->mutable_frames()->rbegin()->set_sequence(sequence);
  }
  return grpc::Status::OK;
}

grpc::Status CameraServiceImpl::CompareFrames(grpc::ServerContext*, const v1::CompareFramesRequest* request,
                                              v1::CompareFramesResponse* response) {
  return answer(comparison_.compare(*request), *response);
}

bool CameraServiceImpl::take_preview(const grpc::ServerContext& context) {
  // One whose client is gone ends as soon as the camera has started and stopped.
  for (const nanoseconds until = monotonic_now() + kPreviewEnds;;
       std::this_thread::sleep_for(kPreviewPause)) {
    const std::lock_guard lock(preview_mutex_);
    if (preview_ == nullptr) {
      preview_ = &context;
      return true;
    }
    if (!preview_->IsCancelled() || monotonic_now() > until) return false;
  }
}

grpc::Status CameraServiceImpl::Preview(grpc::ServerContext* context, const v1::PreviewRequest* request,
                                        grpc::ServerWriter<v1::PreviewResponse>* writer) {
  if (const absl::Status status = check_preview(*request); !status.ok()) return to_grpc(status);
  if (!take_preview(*context))
    return to_grpc(absl::FailedPreconditionError("another preview is running; only one can run at a time"));
  const absl::Cleanup ended = [this] {
    const std::lock_guard lock(preview_mutex_);
    preview_ = nullptr;
  };
  const v1::GetCameraResponse camera = camera_.describe();
  const double exposure_ms =
      request->exposure_ms() != 0.0
          ? request->exposure_ms()
          : std::clamp(kPreviewExposureMs, camera.min_exposure_ms(), camera.max_exposure_ms());
  const std::optional<Mosaic> mosaic = mosaic_of(camera.camera());
  const nanoseconds period(static_cast<std::int64_t>(1e9 / request->max_fps()));
  nanoseconds due = monotonic_now(), asked = due;
  std::int64_t shown = -1;
  // Any other call gets the camera, however long this one takes to start and stop it.
  CameraCall call{.exposure_ms = exposure_ms, .is_gone = [] { return true; }};
  bool running = false;  // the camera, for this call
  const auto give_up = [&] {
    if (!std::exchange(running, false)) return;
    camera_.stop();
    turns_.end(call);
  };
  while (!context->IsCancelled() && !stopping_) {
    const bool preparing = camera_.describe().has_preparation();
    if (turns_.is_wanted() || preparing) give_up();
    if (preparing && !wait_prepared([&] { return context->IsCancelled() || stopping_; }, *writer)) break;
    if (!running && turns_.try_take(call)) {
      running = true;
      if (const absl::Status status = camera_.start(exposure_ms); !status.ok()) {
        give_up();
        return to_grpc(status);
      }
    }
    if (camera.on_demand() && shown < 0 && monotonic_now() >= asked) {
      asked = monotonic_now() + kAskPause;
      v1::PreviewResponse response;
      response.mutable_preparation()->set_what(due_text(camera_.describe()));
      if (!writer->Write(response)) break;
    }
    std::optional<CapturedFrame> frame;
    if (running) {
      frame = camera_.next(kPreviewPause);
    } else {
      std::this_thread::sleep_for(kPreviewPause);
      frame = ring_.newest();
    }
    if (!frame || frame->taken.sequence() == shown || monotonic_now() < due) continue;
    shown = frame->taken.sequence();
    due = std::max(due + period, monotonic_now());
    const absl::StatusOr<Image16> image = frame->image();
    if (!image.ok()) continue;  // the next frame may be intact
    absl::StatusOr<v1::PreviewResponse> response =
        preview_of(*image, mosaic, request->max_width_px(), full_scale_of(camera.camera()));
    if (!response.ok()) {
      give_up();
      return to_grpc(response.status());
    }
    response->set_exposure_ms(frame->taken.exposure_ms());
    response->set_gain(frame->taken.gain());
    if (!writer->Write(*response)) break;
  }
  give_up();
  return grpc::Status::OK;
}

}  // namespace glasswing
