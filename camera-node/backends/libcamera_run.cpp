#include "camera-node/backends/libcamera_run.h"

#include <fmt/format.h>
#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <cassert>
#include <cstring>

#include "core/base/status.h"

namespace glasswing {
namespace {

namespace controls = libcamera::controls;

constexpr size_t kMaxWaiting = 32;  // complete frames not yet taken; beyond that the oldest is dropped

// For USB cameras that report no range, libcamera assumes RGB's full range; their YCbCr has the limited
// range.
ColourCode colour_code(const std::optional<libcamera::ColorSpace>& space, bool usb) {
  using Space = libcamera::ColorSpace;
  ColourCode code;
  if (!space) return code;
  if (space->transferFunction == Space::TransferFunction::Linear)
    code.transfer = ColourCode::Transfer::kLinear;
  if (space->transferFunction == Space::TransferFunction::Rec709)
    code.transfer = ColourCode::Transfer::kRec709;
  if (space->ycbcrEncoding == Space::YcbcrEncoding::Rec709) code.kr = 0.2126, code.kb = 0.0722;
  if (space->ycbcrEncoding == Space::YcbcrEncoding::Rec2020) code.kr = 0.2627, code.kb = 0.0593;
  code.full_range = !usb && space->range == Space::Range::Full;
  return code;
}

absl::Status unavailable(const libcamera::Camera& camera, const char* what, int error) {
  return absl::UnavailableError(
      fmt::format("camera \"{}\" cannot be {}: {}", camera.id(), what, std::strerror(std::abs(error))));
}

}  // namespace

absl::StatusOr<std::unique_ptr<LibcameraRun>> LibcameraRun::begin(
    std::shared_ptr<libcamera::Camera> camera, std::unique_ptr<libcamera::CameraConfiguration> configuration,
    bool usb, const libcamera::ControlList& modes, const libcamera::ControlList& settings) {
  if (const int error = camera->acquire(); error < 0)
    return unavailable(*camera, "opened (another program may be using it)", error);
  std::unique_ptr<LibcameraRun> run(new LibcameraRun(std::move(camera), std::move(configuration)));
  if (const int error = run->camera_->configure(run->configuration_.get()); error < 0)
    return unavailable(*run->camera_, "configured", error);
  GW_RETURN_IF_ERROR(run->map_buffers(usb));
  GW_RETURN_IF_ERROR(run->stream(modes, settings));
  return run;
}

LibcameraRun::LibcameraRun(std::shared_ptr<libcamera::Camera> camera,
                           std::unique_ptr<libcamera::CameraConfiguration> configuration)
    : camera_(std::move(camera)), configuration_(std::move(configuration)), allocator_(camera_) {
  camera_->requestCompleted.connect(this, &LibcameraRun::complete);
  camera_->disconnected.connect(this, &LibcameraRun::disconnected);
}

LibcameraRun::~LibcameraRun() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  camera_->stop();
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  requests_.clear();
  for (const auto& [buffer, planes] : mappings_) {
    for (const Mapping& plane : planes) ::munmap(plane.start, plane.size_bytes);
  }
  allocator_.free(configuration_->at(0).stream());
  camera_->release();
}

absl::Status LibcameraRun::map_buffers(bool usb) {
  const libcamera::StreamConfiguration& stream = configuration_->at(0);
  blank_ = {.format = find_pixel_format(stream.pixelFormat.toString()),
            .width_px = static_cast<int>(stream.size.width),
            .height_px = static_cast<int>(stream.size.height),
            .stride_bytes = stream.stride,
            .colour = colour_code(stream.colorSpace, usb),
            .black = 0.0,
            .planes = {}};
  assert(blank_.format != nullptr);
  // The driver's own buffers, because many drivers cannot write to a program's memory.
  if (const int error = allocator_.allocate(stream.stream()); error < 0)
    return unavailable(*camera_, "given buffers", error);
  for (const auto& buffer : allocator_.buffers(stream.stream())) {
    for (const libcamera::FrameBuffer::Plane& plane : buffer->planes()) {
      Mapping mapping{.dmabuf = plane.fd.get(),
                      .start = nullptr,
                      .size_bytes = size_t{plane.offset} + plane.length,
                      .offset = plane.offset};
      mapping.start = ::mmap(nullptr, mapping.size_bytes, PROT_READ, MAP_SHARED, mapping.dmabuf, 0);
      if (mapping.start == MAP_FAILED) return unavailable(*camera_, "read from", errno);
      mappings_[buffer.get()].push_back(mapping);
    }
  }
  return absl::OkStatus();
}

absl::Status LibcameraRun::stream(const libcamera::ControlList& modes,
                                  const libcamera::ControlList& settings) {
  libcamera::ControlList both = modes;
  both.merge(settings);
  // Some drivers take controls at start, others only with requests.
  if (const int error = camera_->start(&both); error < 0) return unavailable(*camera_, "started", error);
  for (const auto& buffer : allocator_.buffers(configuration_->at(0).stream())) {
    std::unique_ptr<libcamera::Request> request = camera_->createRequest();
    if (request == nullptr) return unavailable(*camera_, "asked for frames", ENODEV);
    request->addBuffer(configuration_->at(0).stream(), buffer.get());
    if (requests_.empty()) request->controls().merge(modes);
    if (requests_.size() == 1) request->controls().merge(settings);
    requests_.push_back(std::move(request));
  }
  for (const auto& request : requests_) {
    if (const int error = camera_->queueRequest(request.get()); error < 0)
      return unavailable(*camera_, "asked for frames", error);
  }
  return absl::OkStatus();
}

void LibcameraRun::complete(libcamera::Request* request) {
  if (request->status() == libcamera::Request::RequestCancelled) {
    refused_ = true;
    arrived_.notify_all();
    return;
  }
  const libcamera::FrameBuffer& buffer = *request->buffers().begin()->second;
  if (buffer.metadata().status == libcamera::FrameMetadata::FrameSuccess) {
    Frame frame = copied(*request, buffer);
    const std::lock_guard lock(mutex_);
    frames_.push_back(std::move(frame));
    if (frames_.size() > kMaxWaiting) frames_.pop_front();
    arrived_.notify_all();
  }
  const std::lock_guard lock(mutex_);
  if (stopping_) return;
  request->reuse(libcamera::Request::ReuseBuffers);
  camera_->queueRequest(request);  // fails once the camera is unplugged; no more frames come then
}

void LibcameraRun::disconnected() {
  gone_ = true;
  arrived_.notify_all();
}

std::optional<double> gain_in(const libcamera::ControlList& metadata, PixelFormat::Kind kind) {
  const bool is_raw = kind == PixelFormat::Kind::kBayer || kind == PixelFormat::Kind::kGray;
  const auto analogue = metadata.get(controls::AnalogueGain), digital = metadata.get(controls::DigitalGain);
  if (is_raw || !digital) return analogue;
  return double{*digital} * analogue.value_or(1.0f);
}

LibcameraRun::Frame LibcameraRun::copied(const libcamera::Request& request,
                                         const libcamera::FrameBuffer& buffer) const {
  // libcamera 0.0.3 offers metadata() only on a non-const request.
  const libcamera::ControlList& metadata = const_cast<libcamera::Request&>(request).metadata();
  Frame frame;
  frame.complete = read_clocks();
  frame.sequence = buffer.metadata().sequence;
  frame.stamp = nanoseconds(metadata.get(controls::SensorTimestamp)
                                .value_or(static_cast<std::int64_t>(buffer.metadata().timestamp)));
  if (const auto exposure_us = metadata.get(controls::ExposureTime)) frame.exposure_ms = *exposure_us / 1e3;
  frame.gain = gain_in(metadata, blank_.format->kind);
  if (const auto skew_ns = metadata.get(controls::draft::SensorRollingShutterSkew))
    frame.readout = nanoseconds(*skew_ns);
  RawPicture picture = blank_;
  if (const auto levels = metadata.get(controls::SensorBlackLevels))
    picture.black = ((*levels)[0] + (*levels)[1] + (*levels)[2] + (*levels)[3]) / 4.0 / 65535.0;
  const std::vector<Mapping>& planes = mappings_.at(&buffer);
  for (size_t p = 0; p < planes.size(); ++p) {
    const Mapping& plane = planes[p];
    // Needed for buffers that are not cache-coherent; others ignore it.
    dma_buf_sync sync{.flags = DMA_BUF_SYNC_START | DMA_BUF_SYNC_READ};
    ::ioctl(plane.dmabuf, DMA_BUF_IOCTL_SYNC, &sync);
    const auto* bytes = static_cast<const std::uint8_t*>(plane.start) + plane.offset;
    const size_t used =
        std::min<size_t>(buffer.metadata().planes()[p].bytesused, plane.size_bytes - plane.offset);
    picture.planes.emplace_back(bytes, bytes + used);
    sync.flags = DMA_BUF_SYNC_END | DMA_BUF_SYNC_READ;
    ::ioctl(plane.dmabuf, DMA_BUF_IOCTL_SYNC, &sync);
  }
  frame.picture = std::make_shared<const RawPicture>(std::move(picture));
  return frame;
}

std::optional<LibcameraRun::Frame> LibcameraRun::next(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  arrived_.wait_for(lock, timeout, [this] { return !frames_.empty() || gone_ || refused_; });
  if (frames_.empty()) return std::nullopt;
  Frame frame = std::move(frames_.front());
  frames_.pop_front();
  return frame;
}

}  // namespace glasswing
