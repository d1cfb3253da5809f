#include "tests/camera-node/backends/aravis/wire_camera.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace glasswing {
namespace {

constexpr std::uint16_t kPort = 3956;
constexpr int kBatch = 32;           // packets sent by one system call
constexpr size_t kRemembered = 8;    // frames that can be sent again
constexpr size_t kWaiting = 4;       // frames exposed and not sent yet
constexpr int kOverhead_bytes = 36;  // of IP, UDP and GVSP in a packet
constexpr nanoseconds kLookAround = std::chrono::milliseconds(50);

enum Command : std::uint16_t {
  kDiscover = 0x02,
  kResend = 0x40,
  kReadRegister = 0x80,
  kWriteRegister = 0x82,
  kReadMemory = 0x84,
  kWriteMemory = 0x86,
};
enum Content : std::uint8_t { kLeader = 1, kTrailer = 2, kPayload = 3 };
constexpr std::uint16_t kResentStatus = 0x0100, kUnavailable = 0x800c;

void put(std::vector<std::uint8_t>& to, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) to.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

std::uint32_t number(std::span<const std::uint8_t> from, size_t at, int bytes) {
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) value = value << 8 | from[at + i];
  return value;
}

std::uint32_t address_of(const std::string& text) {
  return ntohl(::inet_addr(text.c_str()));
}

sockaddr_in peer(std::uint32_t address, std::uint16_t port) {
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(address);
  at.sin_port = htons(port);
  return at;
}

int udp_at(std::uint32_t address, std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), on = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  const sockaddr_in at = peer(address, port);
  ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0) return fd;
  ::close(fd);
  return -1;
}

struct Packet {
  std::vector<std::uint8_t> bytes;
  sockaddr_in from{};
  nanoseconds at{};  // when it arrived, however late this process runs
};

Packet received(int fd) {
  Packet packet{.bytes = std::vector<std::uint8_t>(1024)};
  iovec part{.iov_base = packet.bytes.data(), .iov_len = packet.bytes.size()};
  alignas(cmsghdr) char control[256];
  msghdr message{.msg_name = &packet.from,
                 .msg_namelen = sizeof packet.from,
                 .msg_iov = &part,
                 .msg_iovlen = 1,
                 .msg_control = control,
                 .msg_controllen = sizeof control,
                 .msg_flags = 0};
  const ssize_t size = ::recvmsg(fd, &message, MSG_DONTWAIT);
  packet.bytes.resize(static_cast<size_t>(std::max<ssize_t>(size, 0)));
  timespec now{}, then{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  packet.at = monotonic_now();
  for (cmsghdr* note = CMSG_FIRSTHDR(&message); note != nullptr; note = CMSG_NXTHDR(&message, note)) {
    if (note->cmsg_level != SOL_SOCKET || note->cmsg_type != SCM_TIMESTAMPNS) continue;
    std::memcpy(&then, CMSG_DATA(note), sizeof then);
    packet.at -= std::chrono::seconds(now.tv_sec - then.tv_sec) + nanoseconds(now.tv_nsec - then.tv_nsec);
  }
  return packet;
}

}  // namespace

WireCamera::WireCamera(const Options& options, Expose expose)
    : options_(options),
      expose_(std::move(expose)),
      registers_(address_of(options.address), options.serial, options.sensor, options.chunks, options.ptp) {
  if (!open_sockets()) return;
  threads_.emplace_back([this] { control(); });
  threads_.emplace_back([this] { expose_all(); });
  threads_.emplace_back([this] { send_all(); });
}

WireCamera::~WireCamera() {
  ended_ = true;
  changed_.notify_all();
  threads_.clear();
  for (const int fd : listening_) ::close(fd);
  for (const int fd : {line_fd_, stream_fd_}) {
    if (fd >= 0) ::close(fd);
  }
}

bool WireCamera::open_sockets() {
  const std::uint32_t address = address_of(options_.address);
  const int fd = udp_at(address, kPort);
  if (fd < 0) return false;
  listening_.push_back(fd);
  for (const std::uint32_t broadcast : {0xffffffffu, address | 0xffu, address | 0xffffffu}) {
    if (const int more = udp_at(broadcast, kPort); more >= 0) listening_.push_back(more);
  }
  line_fd_ = udp_at(address, 0);
  stream_fd_ = udp_at(address, 0);
  sockaddr_in at{};
  socklen_t size = sizeof at;
  ::getsockname(line_fd_, reinterpret_cast<sockaddr*>(&at), &size);
  line_port_ = ntohs(at.sin_port);
  const int buffer_bytes = 8 << 20;
  ::setsockopt(stream_fd_, SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
  control_fd_ = fd;
  return true;
}

void WireCamera::control() {
  std::vector<pollfd> polled;
  for (const int fd : listening_) polled.push_back({.fd = fd, .events = POLLIN, .revents = 0});
  polled.push_back({.fd = line_fd_, .events = POLLIN, .revents = 0});
  while (!ended_) {
    ::poll(polled.data(), polled.size(), static_cast<int>(kLookAround / std::chrono::milliseconds(1)));
    for (const pollfd& each : polled) {
      if ((each.revents & POLLIN) == 0) continue;
      if (each.fd != line_fd_) {
        answer(each.fd);
        continue;
      }
      raise_line(received(line_fd_).at);
    }
    // An application that has fallen silent has lost the camera.
    const nanoseconds heartbeat = std::chrono::milliseconds(registers_.get(WireRegisters::kHeartbeat_ms));
    if (registers_.get(WireRegisters::kControl) != 0 && monotonic_now() - commanded_at_ > heartbeat) {
      registers_.set(WireRegisters::kControl, 0);
      running_ = false;
    }
  }
}

void WireCamera::answer(int fd) {
  const Packet packet = received(fd);
  if (packet.bytes.size() < 8 || packet.bytes[0] != 0x42) return;
  const std::uint16_t command = static_cast<std::uint16_t>(number(packet.bytes, 2, 2));
  const std::span<const std::uint8_t> body = std::span(packet.bytes).subspan(8);
  if (command != kDiscover) commanded_at_ = packet.at;
  if (command == kResend) {
    resend(body);
    return;
  }
  const std::vector<std::uint8_t> said = answer_to(command, body);
  std::vector<std::uint8_t> reply;
  put(reply, said.empty() ? 0x8002 : 0, 2);  // invalid parameter
  put(reply, command + 1u, 2);
  put(reply, said.size(), 2);
  put(reply, number(packet.bytes, 6, 2), 2);
  reply.insert(reply.end(), said.begin(), said.end());
  (void)::sendto(control_fd_, reply.data(), reply.size(), 0, reinterpret_cast<const sockaddr*>(&packet.from),
                 sizeof packet.from);
}

std::vector<std::uint8_t> WireCamera::answer_to(std::uint16_t command, std::span<const std::uint8_t> body) {
  std::vector<std::uint8_t> said;
  if (command == kDiscover) {
    said.resize(WireRegisters::kBootstrap_bytes);
    registers_.read(0, said);
  } else if (command == kReadRegister) {
    for (size_t at = 0; at + 4 <= body.size(); at += 4) {
      std::vector<std::uint8_t> value(4);
      if (!registers_.read(number(body, at, 4), value)) return {};
      said.insert(said.end(), value.begin(), value.end());
    }
  } else if (command == kWriteRegister) {
    for (size_t at = 0; at + 8 <= body.size(); at += 8) {
      if (!registers_.write(number(body, at, 4), body.subspan(at + 4, 4))) return {};
      written(number(body, at, 4));
    }
    put(said, body.size() / 8, 4);
  } else if (command == kReadMemory && body.size() >= 8) {
    const std::uint32_t count = number(body, 6, 2);
    put(said, number(body, 0, 4), 4);
    said.resize(4 + count);
    if (count > 540 || !registers_.read(number(body, 0, 4), std::span(said).subspan(4))) return {};
  } else if (command == kWriteMemory && body.size() > 4) {
    if (!registers_.write(number(body, 0, 4), body.subspan(4))) return {};
    written(number(body, 0, 4));
    put(said, body.size() - 4, 4);
  }
  return said;
}

void WireCamera::written(std::uint32_t at) {
  if (at == WireRegisters::kAcquisitionStart) {
    const std::lock_guard lock(mutex_);
    triggers_.clear();
    exposed_.clear();
    running_ = true;
  }
  if (at == WireRegisters::kAcquisitionStop || at == WireRegisters::kControl) running_ = false;
  if (at == WireRegisters::kTriggerSoftware && registers_.get(WireRegisters::kTriggerSource) == 0)
    trigger(commanded_at_ + options_.trigger_latency);
  changed_.notify_all();
}

void WireCamera::raise_line() {
  raise_line(monotonic_now());
}

void WireCamera::raise_line(nanoseconds at) {
  if (registers_.get(WireRegisters::kTriggerSource) != 1) return;
  const double delay_us = registers_.get_double(WireRegisters::kTriggerDelay);
  trigger(at + nanoseconds(std::llround(delay_us * 1e3)));
}

void WireCamera::trigger(nanoseconds at) {
  if (!running_ || registers_.get(WireRegisters::kTriggerMode) == 0) return;
  const std::lock_guard lock(mutex_);
  triggers_.push_back(at);
  changed_.notify_all();
}

std::optional<nanoseconds> WireCamera::next_start(nanoseconds last_start, nanoseconds length) {
  std::unique_lock lock(mutex_);
  if (!running_) {
    changed_.wait_for(lock, kLookAround);
    return std::nullopt;
  }
  const nanoseconds now = monotonic_now();
  if (registers_.get(WireRegisters::kTriggerMode) == 0) {
    const nanoseconds period =
        std::max({nanoseconds(std::llround(1e9 / registers_.get_double(WireRegisters::kFrameRate))), length,
                  options_.min_period});
    return std::max(last_start + period, now);
  }
  if (triggers_.empty()) {
    changed_.wait_for(lock, kLookAround);
    return std::nullopt;
  }
  const nanoseconds at = triggers_.front();
  triggers_.pop_front();
  if (at >= last_start + std::max(length, options_.min_period)) return at;
  ++ignored_;
  return std::nullopt;
}

void WireCamera::expose_all() {
  nanoseconds last{};
  int number = 0;
  while (!ended_) {
    const nanoseconds length(std::llround(registers_.get_double(WireRegisters::kExposureTime) * 1e3));
    const std::optional<nanoseconds> start = next_start(last, length);
    if (!start) continue;
    last = *start;
    sleep_until_monotonic(*start + length);
    const PictureSize size = registers_.size();
    const std::lock_guard lock(mutex_);
    if (!running_) continue;
    ++exposed_count_;
    if (exposed_.size() >= kWaiting) {
      exposed_.pop_front();
      ++overrun_;
    }
    exposed_.push_back({.number = number++,
                        .start = *start,
                        .length = length,
                        .width_px = size.width_px,
                        .height_px = size.height_px});
    changed_.notify_all();
  }
}

void WireCamera::send_all() {
  while (!ended_) {
    std::optional<Exposure> next;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, kLookAround, [this] { return ended_ || !exposed_.empty(); });
      if (!exposed_.empty()) {
        next = exposed_.front();
        exposed_.pop_front();
      }
    }
    if (next) send(*next);
  }
}

std::uint64_t WireCamera::stamp_of(const Exposure& exposure) {
  const nanoseconds at = exposure.start + (options_.stamps_end ? exposure.length : nanoseconds(0));
  if (registers_.get(WireRegisters::kPtpEnable) != 0) {
    timespec real{};
    const nanoseconds before = monotonic_now();
    ::clock_gettime(CLOCK_REALTIME, &real);
    return static_cast<std::uint64_t>(real.tv_sec) * 1000000000u + static_cast<std::uint64_t>(real.tv_nsec) -
           static_cast<std::uint64_t>((before - at).count());
  }
  return static_cast<std::uint64_t>(
      std::llround(static_cast<double>(at.count()) * (1.0 + options_.clock_ppm * 1e-6)));
}

std::shared_ptr<const std::vector<std::uint8_t>> WireCamera::payload_of(
    const Exposure& exposure, std::shared_ptr<const Image16> image) {
  const WireFormat& format = registers_.format();
  const bool chunks = registers_.get(WireRegisters::kChunkMode) != 0;
  const std::uint64_t as =
      static_cast<std::uint64_t>(format.code) << 32 | registers_.get(WireRegisters::kPayloadSize);
  if (image == packed_image_ && as == packed_as_ && !chunks) return packed_;
  auto payload = std::make_shared<std::vector<std::uint8_t>>();
  payload->reserve(registers_.get(WireRegisters::kPayloadSize));
  std::vector<std::uint16_t> row(static_cast<size_t>(image->width_px));
  for (int y = 0; y < image->height_px; ++y) {
    for (int x = 0; x < image->width_px; ++x) {
      // Of RGGB; a grey sensor sees the mean.
      const int channel = (x + y) % 2 == 1 ? 1 : y % 2 == 0 ? 0 : 2;
      row[x] = image->channels == 1 ? image->at(x, y, 0)
               : format.mosaic != 0 ? image->at(x, y, channel)
                                    : static_cast<std::uint16_t>(
                                          (image->at(x, y, 0) + image->at(x, y, 1) + image->at(x, y, 2)) / 3);
    }
    pack(row, format, *payload);
  }
  if (chunks) {
    const auto end_chunk = [&](std::uint32_t id, size_t bytes) {
      put(*payload, id, 4);
      put(*payload, bytes, 4);
    };
    end_chunk(0, payload->size());
    const double values[] = {static_cast<double>(exposure.length.count()) / 1e3,
                             registers_.get_double(WireRegisters::kGain)};
    for (const std::uint32_t id : {WireRegisters::kChunkExposure, WireRegisters::kChunkGain}) {
      if (!registers_.sends_chunk(id)) continue;
      put(*payload, std::bit_cast<std::uint64_t>(values[id - 1]), 8);
      end_chunk(id, 8);
    }
  }
  packed_image_ = std::move(image);
  packed_as_ = as;
  packed_ = payload;
  return payload;
}

void WireCamera::send(const Exposure& exposure) {
  auto frame = std::make_shared<Sent>();
  frame->id = ++frame_id_ == 0 ? ++frame_id_ : frame_id_;
  frame->payload = payload_of(exposure, expose_(exposure));
  const std::uint32_t packet = registers_.get(WireRegisters::kPacketSize) & 0xffff;
  frame->data_bytes = std::max<std::uint32_t>(packet, 64) - kOverhead_bytes;
  const bool chunks = registers_.get(WireRegisters::kChunkMode) != 0;
  const std::uint64_t stamp = stamp_of(exposure);
  put(frame->leader, chunks ? 0x4001 : 0x0001, 4);
  put(frame->leader, stamp, 8);
  for (const std::uint32_t value :
       {registers_.format().code, static_cast<std::uint32_t>(exposure.width_px),
        static_cast<std::uint32_t>(exposure.height_px), registers_.get(WireRegisters::kOffsetX),
        registers_.get(WireRegisters::kOffsetY), 0u})
    put(frame->leader, value, 4);
  put(frame->trailer, chunks ? 0x4001 : 0x0001, 4);
  put(frame->trailer, static_cast<std::uint32_t>(exposure.height_px), 4);
  {
    const std::lock_guard lock(mutex_);
    sent_.push_back(frame);
    if (sent_.size() > kRemembered) sent_.pop_front();
  }
  send_packets(*frame, 0, packet_count(*frame) - 1, false);
}

std::uint32_t WireCamera::packet_count(const Sent& frame) const {
  return static_cast<std::uint32_t>((frame.payload->size() + frame.data_bytes - 1) / frame.data_bytes) + 2;
}

void WireCamera::send_packets(const Sent& frame, std::uint32_t from, std::uint32_t to, bool again) {
  const sockaddr_in at = peer(registers_.get(WireRegisters::kStreamAddress),
                              static_cast<std::uint16_t>(registers_.get(WireRegisters::kStreamPort)));
  const std::uint32_t last = packet_count(frame) - 1;
  std::uint8_t headers[kBatch][8];
  iovec parts[kBatch][2];
  mmsghdr messages[kBatch];
  int count = 0;
  nanoseconds due = monotonic_now();
  const auto flush = [&] {
    for (int done = 0; done < count;) {
      const int sent = ::sendmmsg(stream_fd_, messages + done, static_cast<unsigned>(count - done), 0);
      if (sent <= 0) break;  // nobody listens any more
      done += sent;
    }
    if (options_.bytes_per_s > 0.0) {
      due += nanoseconds(
          std::llround(1e9 * count * (frame.data_bytes + kOverhead_bytes) / options_.bytes_per_s));
      sleep_until_monotonic(due);
    }
    count = 0;
  };
  std::bernoulli_distribution is_lost(options_.lost);
  for (std::uint32_t id = from; id <= std::min(to, last); ++id) {
    ++packets_;
    {
      const std::lock_guard lock(send_mutex_);
      if (is_lost(random_)) {
        ++lost_;
        continue;
      }
    }
    resent_ += again ? 1 : 0;
    const std::uint8_t content = id == 0 ? kLeader : id == last ? kTrailer : kPayload;
    std::vector<std::uint8_t> header;
    put(header, again ? kResentStatus : 0, 2);
    put(header, frame.id, 2);
    put(header, static_cast<std::uint32_t>(content) << 24 | id, 4);
    std::ranges::copy(header, headers[count]);
    std::span<const std::uint8_t> data = id == 0 ? std::span(frame.leader) : std::span(frame.trailer);
    if (content == kPayload) {
      data = std::span(*frame.payload).subspan(static_cast<size_t>(id - 1) * frame.data_bytes);
      data = data.first(std::min<size_t>(data.size(), frame.data_bytes));
    }
    parts[count][0] = {.iov_base = headers[count], .iov_len = 8};
    parts[count][1] = {.iov_base = const_cast<std::uint8_t*>(data.data()), .iov_len = data.size()};
    messages[count] = {};
    messages[count].msg_hdr = {.msg_name = const_cast<sockaddr_in*>(&at),
                               .msg_namelen = sizeof at,
                               .msg_iov = parts[count],
                               .msg_iovlen = 2,
                               .msg_control = nullptr,
                               .msg_controllen = 0,
                               .msg_flags = 0};
    if (++count == kBatch) flush();
  }
  flush();
}

void WireCamera::resend(std::span<const std::uint8_t> body) {
  if (!options_.resends || body.size() < 12) return;
  const std::uint32_t id = number(body, 2, 2), first = number(body, 4, 4) & 0xffffff,
                      last = number(body, 8, 4) & 0xffffff;
  std::shared_ptr<const Sent> frame;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& each : sent_) {
      if (each->id == id) frame = each;
    }
  }
  if (frame != nullptr) {
    send_packets(*frame, first, last, true);
    return;
  }
  const sockaddr_in at = peer(registers_.get(WireRegisters::kStreamAddress),
                              static_cast<std::uint16_t>(registers_.get(WireRegisters::kStreamPort)));
  std::vector<std::uint8_t> gone;
  put(gone, kUnavailable, 2);
  put(gone, id, 2);
  put(gone, static_cast<std::uint32_t>(kPayload) << 24 | first, 4);
  (void)::sendto(stream_fd_, gone.data(), gone.size(), 0, reinterpret_cast<const sockaddr*>(&at), sizeof at);
}

void WireCamera::set_exposure(double exposure_ms) {
  registers_.set_double(WireRegisters::kExposureTime, 1e3 * exposure_ms);
}

WireCamera::Counts WireCamera::counts() const {
  return {.exposed = exposed_count_,
          .ignored = ignored_,
          .overrun = overrun_,
          .packets = packets_,
          .lost = lost_,
          .resent = resent_};
}

}  // namespace glasswing
