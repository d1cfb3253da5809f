// A graphics card, as driven by the Linux kernel (DRM/KMS, atomic): its connectors, framebuffers in its
// memory, and requests that change what it shows.
#pragma once

#include <absl/status/statusor.h>
#include <xf86drmMode.h>

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/time.h"

namespace glasswing {

class DrmCard {
 public:
  // "/dev/dri/card0". UNAVAILABLE: it cannot be opened; FAILED_PRECONDITION: it lacks a required feature.
  static absl::StatusOr<std::unique_ptr<DrmCard>> open(const std::string& path);
  // Restores what set() changed.
  ~DrmCard();
  DrmCard(const DrmCard&) = delete;
  DrmCard& operator=(const DrmCard&) = delete;

  const std::string& name() const { return name_; }  // "card0"
  int events_fd() const { return fd_; }              // readable when read_events() has something

  struct Connector {
    std::string name;  // "HDMI-A-1"
    std::uint32_t id = 0;
    std::uint32_t possible_crtcs = 0;    // bit i: the card's i-th CRTC
    std::uint32_t current_crtc = 0;      // 0: none
    std::vector<drmModeModeInfo> modes;  // the preferred one first; empty: nothing is plugged in
  };
  const std::vector<Connector>& connectors() const { return connectors_; }

  // The hardware that turns a framebuffer into a signal.
  struct Pipe {
    std::uint32_t crtc = 0;
    std::uint32_t plane = 0;  // the primary one
    std::uint32_t framebuffer_property = 0;
    int bits = 8;  // of a code
  };
  // Reserves a free pipe for the connector. `bits`: of a code, 8 or 10. FAILED_PRECONDITION: no pipe is free,
  // or it does not support codes with this many bits.
  absl::StatusOr<Pipe> claim(const Connector& connector, int bits);

  struct Framebuffer {
    std::uint32_t id = 0;
    std::uint8_t* pixels = nullptr;  // words of 32 bits, blue lowest; mapped until the card is closed
    size_t stride_bytes = 0;
  };
  absl::StatusOr<Framebuffer> make_framebuffer(const Pipe& pipe, int width_px, int height_px);

  // Shows the framebuffer, of the mode's size, through the pipe, codes unchanged. The first call turns off
  // all of the card's outputs. FAILED_PRECONDITION: another program holds the card, or the card refuses.
  absl::Status set(const Connector& connector, const Pipe& pipe, const drmModeModeInfo& mode,
                   const Framebuffer& framebuffer);

  struct Refresh {
    std::uint64_t number = 0;
    nanoseconds start{};  // of its first row, CLOCK_MONOTONIC
  };
  struct Event {
    std::uint64_t serial = 0;
    nanoseconds refresh_start{};
  };
  // The following are UNAVAILABLE if the monitor or the card has been removed.
  absl::StatusOr<Refresh> last_refresh(const Pipe& pipe) const;
  // Requests an event for the start of that refresh; it comes at once if the refresh has begun.
  absl::Status ask_for(const Pipe& pipe, std::uint64_t refresh, std::uint64_t serial);
  // Shows the framebuffer from the next refresh on, and requests an event for it.
  absl::Status flip(const Pipe& pipe, const Framebuffer& framebuffer, std::uint64_t serial);
  // The events that have arrived.
  absl::StatusOr<std::vector<Event>> read_events();

 private:
  struct Setting {
    std::uint32_t object = 0, property = 0;
    std::uint64_t value = 0;
  };
  struct Memory {
    void* mapped = nullptr;
    size_t bytes = 0;
  };
  struct Property {
    std::uint32_t id = 0;
    std::uint64_t value = 0;
    bool blob = false;
  };
  using Properties = std::map<std::string, Property>;

  DrmCard() = default;
  absl::Status check_abilities();
  void find_connectors();
  Properties properties_of(std::uint32_t object) const;
  // Adds a setting and remembers the old value. Does nothing if the object lacks the property.
  void change(std::vector<Setting>& settings, std::uint32_t object, const Properties& properties,
              const char* name, std::uint64_t value);
  absl::Status turn_off();
  absl::Status commit(const std::vector<Setting>& settings, std::uint32_t flags, std::uint64_t serial) const;

  std::string name_;
  int fd_ = -1;
  std::vector<std::uint32_t> crtcs_;
  std::vector<Connector> connectors_;
  std::set<std::uint32_t> claimed_;                                          // CRTCs and planes
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> before_;  // by object and property
  std::vector<Memory> memory_;
};

// The refresh rate of a progressive mode.
inline double refresh_hz_of(const drmModeModeInfo& mode) {
  return 1e3 * mode.clock / (static_cast<double>(mode.htotal) * mode.vtotal);
}

}  // namespace glasswing
