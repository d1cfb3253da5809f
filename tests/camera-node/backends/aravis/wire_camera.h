// A GigE Vision camera that speaks GVCP and GVSP at an address of this machine, written for tests: packed
// formats, chunks, packets resent on request, time stamps of its own clock or of PTP, software triggers and a
// trigger line. It exposes at the times it says: exposing, drawing and sending overlap, as in a camera.
//
// Register map: wire_registers.h. A rising edge of Line1 is a UDP datagram to its line port.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <thread>

#include "core/base/time.h"
#include "core/image/image.h"
#include "tests/camera-node/backends/aravis/wire_registers.h"

namespace glasswing {

class WireCamera {
 public:
  struct Exposure {
    int number = 0;                 // counts from 0
    nanoseconds start{}, length{};  // CLOCK_MONOTONIC
    int width_px = 0, height_px = 0;
  };
  // What the sensor sees, 1 or 3 channels; called once the exposure has ended. The same picture again is
  // packed only once.
  using Expose = std::function<std::shared_ptr<const Image16>(const Exposure&)>;
  struct Options {
    std::string address = "127.0.0.1", serial = "1";
    PictureSize sensor{2592, 1944};
    double lost = 0.0;  // part of the packets of pictures that it loses, each on its own
    bool resends = true, chunks = true, ptp = true;
    bool stamps_end = false;   // of the exposure, not its start
    double clock_ppm = 0.0;    // by which its clock is fast
    nanoseconds min_period{};  // from a triggered exposure's start to the next one's
    double bytes_per_s = 0.0;  // that it sends at most; 0: as fast as this machine takes them
    nanoseconds trigger_latency = std::chrono::microseconds(100);
  };
  struct Counts {
    std::int64_t exposed = 0;  // pictures
    std::int64_t ignored = 0;  // triggers, while it was exposing
    std::int64_t overrun = 0;  // pictures that it could not send in time
    std::int64_t packets = 0, lost = 0, resent = 0;
  };

  WireCamera(const Options& options, Expose expose);
  ~WireCamera();
  WireCamera(const WireCamera&) = delete;
  WireCamera& operator=(const WireCamera&) = delete;
  bool is_running() const { return control_fd_ >= 0; }
  int line_port() const { return line_port_; }
  // Raises Line1 now.
  void raise_line();
  // As if another program had set it.
  void set_exposure(double exposure_ms);
  Counts counts() const;

 private:
  struct Sent {  // a frame that can be sent again
    std::uint16_t id = 0;
    std::vector<std::uint8_t> leader, trailer;
    std::shared_ptr<const std::vector<std::uint8_t>> payload;
    std::uint32_t data_bytes = 0;  // of a packet
  };

  bool open_sockets();
  void control();     // a thread: commands, and the line
  void expose_all();  // a thread: times of the exposures
  void send_all();    // a thread: pictures
  void raise_line(nanoseconds at);
  void answer(int fd);
  std::vector<std::uint8_t> answer_to(std::uint16_t command, std::span<const std::uint8_t> body);
  void written(std::uint32_t at);
  void resend(std::span<const std::uint8_t> body);
  void trigger(nanoseconds at);
  std::optional<nanoseconds> next_start(nanoseconds last_start, nanoseconds length);
  std::uint64_t stamp_of(const Exposure& exposure);
  std::shared_ptr<const std::vector<std::uint8_t>> payload_of(const Exposure& exposure,
                                                              std::shared_ptr<const Image16> image);
  void send(const Exposure& exposure);
  std::uint32_t packet_count(const Sent& frame) const;
  // Packets `from` to `to` of a frame; the leader is number 0.
  void send_packets(const Sent& frame, std::uint32_t from, std::uint32_t to, bool again);

  const Options options_;
  const Expose expose_;
  WireRegisters registers_;
  int control_fd_ = -1, line_fd_ = -1, stream_fd_ = -1, line_port_ = 0;
  std::vector<int> listening_;  // control_fd_ and those for broadcasts
  std::atomic<bool> ended_ = false, running_ = false;
  nanoseconds commanded_at_{};  // by the control thread
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<nanoseconds> triggers_;              // starts of exposures; guarded by mutex_
  std::deque<Exposure> exposed_;                  // to be sent; guarded by mutex_
  std::deque<std::shared_ptr<const Sent>> sent_;  // newest last; guarded by mutex_
  std::mt19937_64 random_{7};                     // guarded by send_mutex_
  std::mutex send_mutex_;
  std::shared_ptr<const Image16> packed_image_;  // by the sending thread
  std::shared_ptr<const std::vector<std::uint8_t>> packed_;
  std::uint64_t packed_as_ = 0;
  std::uint16_t frame_id_ = 0;
  std::atomic<std::int64_t> exposed_count_ = 0, ignored_ = 0, overrun_ = 0, packets_ = 0, lost_ = 0,
                            resent_ = 0;
  std::vector<std::jthread> threads_;
};

}  // namespace glasswing
