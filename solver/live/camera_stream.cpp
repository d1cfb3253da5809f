#include "solver/live/camera_stream.h"

#include <cstring>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {

CameraStream::CameraStream(const std::string& address, double exposure_ms)
    : title_("camera node at " + address),
      stub_(v1::CameraService::NewStub(dial(address, only(Role::kCamera)))) {
  v1::StreamFramesRequest request;
  request.set_exposure_ms(exposure_ms);
  reader_ = stub_->StreamFrames(&context_, request);
  thread_ = std::thread([this] { read(); });
}

CameraStream::~CameraStream() {
  context_.TryCancel();
  thread_.join();
}

absl::StatusOr<v1::Camera> CameraStream::describe() {
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  v1::GetCameraResponse response;
  GW_RETURN_IF_ERROR(from_grpc(stub_->GetCamera(&context, {}, &response), title_));
  return response.camera();
}

absl::StatusOr<std::optional<StreamedFrame>> CameraStream::newest(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [this] { return newest_ || end_; });
  if (end_) return *end_;
  return std::exchange(newest_, std::nullopt);
}

void CameraStream::read() {
  v1::StreamFramesResponse response;
  StreamedFrame frame;
  std::shared_ptr<std::vector<std::uint16_t>> samples;
  size_t filled_bytes = 0;
  while (reader_->Read(&response)) {
    if (response.has_frame()) {
      frame.taken = response.frame();
      samples = std::make_shared<std::vector<std::uint16_t>>(3 * static_cast<size_t>(frame.taken.width_px()) *
                                                             frame.taken.height_px());
      filled_bytes = 0;
    }
    if (samples == nullptr) continue;
    const size_t size_bytes = samples->size() * sizeof(std::uint16_t);
    if (response.chunk().size() > size_bytes - filled_bytes) {  // the frame exceeds its announced size
      context_.TryCancel();
      continue;
    }
    std::memcpy(reinterpret_cast<char*>(samples->data()) + filled_bytes, response.chunk().data(),
                response.chunk().size());
    filled_bytes += response.chunk().size();
    if (filled_bytes < size_bytes) continue;
    frame.samples = std::move(samples);
    frame.came = monotonic_now();
    const std::lock_guard lock(mutex_);
    newest_ = frame;
    changed_.notify_all();
  }
  absl::Status status = from_grpc(reader_->Finish(), title_);
  if (status.ok() || absl::IsCancelled(status))
    status = absl::UnavailableError(title_ + " stopped sending frames");
  const std::lock_guard lock(mutex_);
  end_ = std::move(status);
  changed_.notify_all();
}

}  // namespace glasswing
