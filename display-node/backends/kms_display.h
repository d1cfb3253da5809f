// Monitors of a bare console, through the kernel's atomic modesetting: each picture is drawn into a
// framebuffer of the card, a page flip shows it from the next refresh on, and the kernel reports that
// refresh's time.
//
// That time is when the scan-out of the refresh's first row begins (Linux,
// drm_crtc_funcs.get_vblank_timestamp: "the time immediately after end of the vblank interval"),
// CLOCK_MONOTONIC in microseconds. The rows take vdisplay / vtotal of the period htotal vtotal / clock; the
// rest is blanking. Codes have 8 bits, or 10 if the card's plane supports XRGB2101010.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "display-node/backends/drm_card.h"
#include "display-node/display.h"

namespace glasswing {

class KmsDisplay final : public Display {
 public:
  struct Monitor {
    std::string name;       // in the rig
    std::string connector;  // "HDMI-A-1", or with its card "card0:HDMI-A-1"
    int width_px = 0;       // 0: the monitor's preferred mode
    int height_px = 0;
    double refresh_hz = 0.0;  // 0: the first mode of that size; otherwise the nearest within 0.5 Hz
  };
  struct Options {
    std::vector<Monitor> monitors;  // empty: all that are plugged in, by their connectors' names
    int bits = 8;                   // of a code: 8 or 10
    nanoseconds lag{}, settle{};
  };
  // NOT_FOUND: no card, no such monitor or no such mode; lists the available ones. INVALID_ARGUMENT: a
  // monitor is named twice. FAILED_PRECONDITION: another program holds the card, or the card cannot show
  // this. Closing the display restores the console.
  static absl::StatusOr<std::unique_ptr<KmsDisplay>> open(const Options& options);
  ~KmsDisplay() override;
  KmsDisplay(const KmsDisplay&) = delete;
  KmsDisplay& operator=(const KmsDisplay&) = delete;

  std::string backend() const override { return "kms"; }
  const std::vector<ScreenInfo>& screens() const override { return screens_; }
  // UNAVAILABLE: a monitor was unplugged, or has not refreshed for two seconds.
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

 private:
  struct Buffer {
    DrmCard::Framebuffer memory;
    Picture held;  // its content; null, black, at first
  };
  enum class Stage { kShown, kWaiting, kFlipping };
  struct Output {
    DrmCard* card = nullptr;
    DrmCard::Pipe pipe;
    std::array<Buffer, 2> buffers;
    size_t on_screen = 0;  // of buffers
    nanoseconds blanking{};
    int status_fd = -1;  // the connector's status in sysfs
    Stage stage = Stage::kShown;
    std::uint64_t serial = 0;   // of the awaited event
    nanoseconds shown_start{};  // of the newest picture's first row
  };

  KmsDisplay() = default;
  absl::Status open_output(DrmCard& card, const DrmCard::Connector& connector, const drmModeModeInfo& mode,
                           int bits);
  void fill(Buffer& buffer, const ScreenInfo& screen, const Picture& picture);
  // Flips if the next refresh is the one for `at`; otherwise requests an event for the previous refresh.
  absl::Status advance(size_t index, nanoseconds at);
  absl::Status take_events(DrmCard& card, nanoseconds at);
  // Waits until every output's picture is on screen, up to kPatience beyond `at`.
  absl::Status wait_for_all(nanoseconds at);
  absl::Status check_plugged_in(size_t index) const;

  std::vector<std::unique_ptr<DrmCard>> cards_;
  std::vector<ScreenInfo> screens_;
  std::vector<Output> outputs_;
  std::uint64_t serial_ = 0;
};

}  // namespace glasswing
