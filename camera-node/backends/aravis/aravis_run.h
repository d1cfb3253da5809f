// One run of a camera under Aravis: streaming from its creation to its destruction.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "camera-node/backends/aravis/aravis_device.h"
#include "camera-node/backends/pixel_format.h"
#include "core/base/time.h"

namespace glasswing {

// The size of a socket's buffer (SO_RCVBUF) that holds this many frames, so that none is lost while this
// machine is busy. The kernel allows net.core.rmem_max.
inline constexpr int kSocketFrames = 4;
size_t wanted_socket_bytes(size_t frame_bytes, size_t packet_bytes);

class AravisRun {
 public:
  struct Frame {
    std::shared_ptr<const RawPicture> picture;
    std::uint64_t id = 0;                     // the camera's number of it
    nanoseconds stamp{};                      // the camera's
    nanoseconds first{};                      // CLOCK_MONOTONIC: its first byte was here
    nanoseconds complete{};                   // CLOCK_MONOTONIC: its last was
    const char* fault = nullptr;              // null: it is whole; else there is no picture
    std::optional<double> exposure_us, gain;  // the camera's, of this frame, from its chunks
  };
  // `trigger`: the source of triggers; empty: free-running. `blank`: the properties that all pictures share.
  static absl::StatusOr<std::unique_ptr<AravisRun>> begin(std::shared_ptr<AravisDevice> device,
                                                          const RawPicture& blank,
                                                          const std::string& trigger);
  ~AravisRun();
  AravisRun(const AravisRun&) = delete;
  AravisRun& operator=(const AravisRun&) = delete;

  std::optional<Frame> next(std::chrono::milliseconds timeout);
  // Whether its triggers have this source.
  bool waits_for(std::string_view trigger) const { return trigger_ == trigger; }
  // Sends a trigger.
  absl::Status trigger() const;
  // Packets that never arrived, since the run began; 0 for a camera without packets.
  std::uint64_t missing_packets() const;
  // Frames that were not taken in time and dropped, since the last call.
  int take_overrun();
  bool lost() const { return device_->lost(); }

 private:
  AravisRun(std::shared_ptr<AravisDevice> device, const RawPicture& blank, const std::string& trigger)
      : device_(std::move(device)), blank_(blank), trigger_(trigger) {}
  absl::Status stream();
  // On Aravis' thread, which must be back at its socket before that overflows.
  static void call_back(void* run, ArvStreamCallbackType type, ArvBuffer* buffer);
  struct Arrived {
    GPtr<ArvBuffer> buffer;
    nanoseconds first{}, complete{};
  };
  void take();
  Frame copied(const Arrived& arrived) const;
  void read_chunks(ArvBuffer* buffer, Frame& frame) const;

  const std::shared_ptr<AravisDevice> device_;
  const RawPicture blank_;
  const std::string trigger_;
  ArvPixelFormat format_ = 0;
  GPtr<ArvChunkParser> chunks_;  // null: the camera sends none
  GPtr<ArvStream> stream_;
  std::atomic<bool> ended_ = false;
  std::map<const ArvBuffer*, nanoseconds> begun_;  // being filled, since when; used by Aravis' thread alone
  std::mutex mutex_;
  std::condition_variable arrived_;
  size_t max_waiting_ = 0;      // beyond that the oldest is dropped
  std::deque<Arrived> frames_;  // not yet taken; guarded by mutex_
  int overrun_ = 0;             // guarded by mutex_
};

}  // namespace glasswing
