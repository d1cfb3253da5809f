#include "camera-node/backends/aravis/aravis_run.h"

#include <sys/resource.h>

#include <algorithm>
#include <bit>

#include "core/base/status.h"

namespace glasswing {
namespace {

// Frames held, of which Aravis needs some to fill.
constexpr size_t kBuffers_bytes = 128 << 20, kMinBuffers = 8, kMaxBuffers = 36, kFilled = 4;
constexpr int kReceiverNice = -10;

const char* fault_of(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_SUCCESS:
      return nullptr;
    case ARV_BUFFER_STATUS_TIMEOUT:
      return "its end did not arrive in time";
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
      return "packets are missing";
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
      return "packets have wrong numbers";
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      return "it is larger than announced";
    default:
      return "it was interrupted";
  }
}

}  // namespace

size_t wanted_socket_bytes(size_t frame_bytes, size_t packet_bytes) {
  // The kernel charges a packet with its memory block, a power of two that also holds about 500 bytes of its
  // own, and a descriptor of 256; and it doubles the size that is set.
  constexpr size_t kMin_bytes = 2 << 20, kMax_bytes = 256 << 20;
  const size_t packets = frame_bytes / std::max<size_t>(packet_bytes, 1) + 1;
  return std::clamp(kSocketFrames * packets * (std::bit_ceil(packet_bytes + 500) + 256) / 2, kMin_bytes,
                    kMax_bytes);
}

absl::StatusOr<std::unique_ptr<AravisRun>> AravisRun::begin(std::shared_ptr<AravisDevice> device,
                                                            const RawPicture& blank,
                                                            const std::string& trigger) {
  std::unique_ptr<AravisRun> run(new AravisRun(std::move(device), blank, trigger));
  GW_RETURN_IF_ERROR(run->stream());
  return run;
}

absl::Status AravisRun::stream() {
  ArvCamera* const camera = device_->get();
  GW_RETURN_IF_ERROR(arv_call(trigger_.empty() ? "run freely" : "wait for triggers", [&](GError** error) {
    if (trigger_.empty()) {
      arv_camera_clear_triggers(camera, error);
    } else {
      arv_camera_set_trigger(camera, trigger_.c_str(), error);
    }
  }));
  if (!device_->chunks().empty()) chunks_.reset(arv_camera_create_chunk_parser(camera));
  GW_RETURN_IF_ERROR(arv_call("stream", [&](GError** error) {
    stream_.reset(arv_camera_create_stream(camera, &call_back, this, error));
  }));
  GW_ASSIGN_OR_RETURN(const guint payload, arv_call("tell the size of a frame", [&](GError** error) {
                        return arv_camera_get_payload(camera, error);
                      }));
  GW_ASSIGN_OR_RETURN(format_, arv_call("tell its pixel format", [&](GError** error) {
                        return arv_camera_get_pixel_format(camera, error);
                      }));
  if (ARV_IS_GV_STREAM(stream_.get())) {
    GW_ASSIGN_OR_RETURN(const guint packet, arv_call("tell its packet size", [&](GError** error) {
                          return arv_camera_gv_get_packet_size(camera, error);
                        }));
    g_object_set(stream_.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
                 static_cast<gint>(wanted_socket_bytes(payload, packet)), "packet-resend",
                 ARV_GV_STREAM_PACKET_RESEND_ALWAYS, nullptr);
  }
  const size_t buffers = std::clamp(kBuffers_bytes / std::max(payload, 1u), kMinBuffers, kMaxBuffers);
  max_waiting_ = buffers - kFilled;
  for (size_t i = 0; i < buffers; ++i)
    arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload, nullptr));
  return arv_call("start", [&](GError** error) { arv_camera_start_acquisition(camera, error); });
}

AravisRun::~AravisRun() {
  arv_camera_stop_acquisition(device_->get(), nullptr);  // fails where the camera is gone
  ended_ = true;                                         // the stream still reports what it aborts
  // Ends its thread, which uses the other members, and this pointer until it has ended.
  if (stream_ != nullptr) g_object_unref(stream_.get());
  (void)stream_.release();
}

void AravisRun::call_back(void* run, ArvStreamCallbackType type, ArvBuffer* buffer) {
  auto& self = *static_cast<AravisRun*>(run);
  if (type == ARV_STREAM_CALLBACK_TYPE_INIT) (void)::setpriority(PRIO_PROCESS, 0, kReceiverNice);
  if (type == ARV_STREAM_CALLBACK_TYPE_START_BUFFER) self.begun_[buffer] = monotonic_now();
  if (type == ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) self.take();
}

void AravisRun::take() {
  if (ended_) return;
  Arrived arrived{.buffer = GPtr<ArvBuffer>(arv_stream_pop_buffer(stream_.get())),
                  .complete = monotonic_now()};
  if (arrived.buffer == nullptr) return;
  const auto begun = begun_.find(arrived.buffer.get());
  arrived.first = begun == begun_.end() ? arrived.complete : begun->second;
  begun_.erase(arrived.buffer.get());
  const std::lock_guard lock(mutex_);
  frames_.push_back(std::move(arrived));
  if (frames_.size() > max_waiting_) {
    arv_stream_push_buffer(stream_.get(), frames_.front().buffer.release());
    frames_.pop_front();
    ++overrun_;
  }
  arrived_.notify_all();
}

AravisRun::Frame AravisRun::copied(const Arrived& arrived) const {
  ArvBuffer* const buffer = arrived.buffer.get();
  Frame frame;
  frame.complete = arrived.complete;
  frame.first = arrived.first;
  frame.id = arv_buffer_get_frame_id(buffer);
  frame.stamp = nanoseconds(arv_buffer_get_timestamp(buffer));
  frame.fault = fault_of(arv_buffer_get_status(buffer));
  if (frame.fault != nullptr) return frame;
  const ArvBufferPayloadType payload = arv_buffer_get_payload_type(buffer);
  if (payload != ARV_BUFFER_PAYLOAD_TYPE_IMAGE && payload != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA) {
    frame.fault = "it does not contain a plain image";
    return frame;
  }
  if (arv_buffer_get_image_width(buffer) != blank_.width_px ||
      arv_buffer_get_image_height(buffer) != blank_.height_px ||
      arv_buffer_get_image_pixel_format(buffer) != format_) {
    frame.fault = "its size or pixel format differs";
    return frame;
  }
  size_t size_bytes = 0;
  const auto* bytes = static_cast<const std::uint8_t*>(arv_buffer_get_image_data(buffer, &size_bytes));
  const size_t image_bytes = blank_.stride_bytes * static_cast<size_t>(blank_.height_px);
  if (bytes == nullptr || size_bytes < image_bytes) {
    frame.fault = "it is shorter than its size requires";
    return frame;
  }
  if (chunks_ != nullptr && arv_buffer_has_chunks(buffer)) read_chunks(buffer, frame);
  RawPicture picture = blank_;
  picture.planes.emplace_back(bytes, bytes + image_bytes);
  frame.picture = std::make_shared<const RawPicture>(std::move(picture));
  return frame;
}

void AravisRun::read_chunks(ArvBuffer* buffer, Frame& frame) const {
  const auto value_of = [&](const char* chunk) -> std::optional<double> {
    GError* error = nullptr;
    const double value = arv_chunk_parser_get_float_value(chunks_.get(), buffer, chunk, &error);
    if (error == nullptr) return value;
    g_clear_error(&error);
    return std::nullopt;
  };
  for (const std::string& chunk : device_->chunks()) {
    if (chunk == "ExposureTime") frame.exposure_us = value_of("ChunkExposureTime");
    if (chunk == "Gain") frame.gain = value_of("ChunkGain");
  }
}

int AravisRun::take_overrun() {
  const std::lock_guard lock(mutex_);
  return std::exchange(overrun_, 0);
}

std::optional<AravisRun::Frame> AravisRun::next(std::chrono::milliseconds timeout) {
  Arrived arrived;
  {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, timeout, [this] { return !frames_.empty(); });
    if (frames_.empty()) return std::nullopt;
    arrived = std::move(frames_.front());
    frames_.pop_front();
  }
  Frame frame = copied(arrived);
  arv_stream_push_buffer(stream_.get(), arrived.buffer.release());
  return frame;
}

absl::Status AravisRun::trigger() const {
  return arv_call("take a trigger",
                  [&](GError** error) { arv_camera_software_trigger(device_->get(), error); });
}

std::uint64_t AravisRun::missing_packets() const {
  return ARV_IS_GV_STREAM(stream_.get())
             ? arv_stream_get_info_uint64_by_name(stream_.get(), "n_missing_packets")
             : 0;
}

}  // namespace glasswing
