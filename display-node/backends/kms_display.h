// Monitors of a bare console, by the kernel's atomic modesetting: each picture lies in a buffer of the card,
// which a page flip puts on screen from one refresh to the next, and the kernel reports that refresh's time.
//
// That time is when the refresh's first row begins to be scanned out (Linux,
// drm_crtc_funcs.get_vblank_timestamp: "the time immediately after end of the vblank interval"),
// CLOCK_MONOTONIC in microseconds. Of a period htotal vtotal / clock the rows take vdisplay / vtotal; the
// rest is blanking. Codes are of 8 bits, or of 10 where the card's plane takes XRGB2101010.
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
    std::string connector;  // "HDMI-A-1", or of one card "card0:HDMI-A-1"
    int width_px = 0;       // 0: the monitor's preferred mode
    int height_px = 0;
    double refresh_hz = 0.0;  // 0: the first of that size; else the nearest within 0.5
  };
  struct Options {
    std::vector<Monitor> monitors;  // none: all that are plugged in, by their connectors' names
    int bits = 8;                   // of a code: 8 or 10
    nanoseconds lag{}, settle{};
  };
  // NOT_FOUND: no card, no such monitor or no such mode; lists what there is. INVALID_ARGUMENT: a monitor
  // twice. FAILED_PRECONDITION: another program holds the card, or the card cannot show this. The console is
  // as it was when the display is closed.
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
    Picture held;  // what it shows; at first, black
  };
  enum class Stage { kShown, kWaiting, kFlipping };
  struct Output {
    DrmCard* card = nullptr;
    DrmCard::Pipe pipe;
    std::array<Buffer, 2> buffers;
    size_t on_screen = 0;  // of buffers
    nanoseconds blanking{};
    int status_fd = -1;  // what the kernel says of the plug
    Stage stage = Stage::kShown;
    std::uint64_t serial = 0;   // of the event that is waited for
    nanoseconds shown_start{};  // of the newest picture's first row
  };

  KmsDisplay() = default;
  absl::Status open_output(DrmCard& card, const DrmCard::Connector& connector, const drmModeModeInfo& mode,
                           int bits);
  void fill(Buffer& buffer, const ScreenInfo& screen, const Picture& picture);
  // Hands the picture to the card when the refresh before the one it is for has begun; until then, waits for
  // that.
  absl::Status advance(size_t index, nanoseconds at);
  absl::Status take_events(DrmCard& card, nanoseconds at);
  // Until every output's picture is on screen, for a while longer than until `at`.
  absl::Status wait_for_all(nanoseconds at);
  absl::Status check_plugged_in(size_t index) const;

  std::vector<std::unique_ptr<DrmCard>> cards_;
  std::vector<ScreenInfo> screens_;
  std::vector<Output> outputs_;
  std::uint64_t serial_ = 0;
};

}  // namespace glasswing
