// Monitors of an X server, through its Present extension (version 1.0): each picture is a pixmap that the
// server copies or flips to a full-screen window at a given refresh (MSC). The server reports the refresh and
// its time on CLOCK_MONOTONIC (UST).
//
// Monitors are those listed by RANDR (1.5). Codes have 8 bits on a server of depth 24, 10 on one of
// depth 30.
#pragma once

#include <xcb/present.h>
#include <xcb/xcb.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

class X11Display final : public Display {
 public:
  struct Options {
    std::string server;  // ":0"; empty: $DISPLAY
    // Name in the rig, and RANDR's name; empty: all monitors, by RANDR's names.
    std::vector<std::pair<std::string, std::string>> monitors;
    int bits = 8;  // of a code: 8 or 10
    nanoseconds lag{}, settle{};
  };
  // UNAVAILABLE: no such server. FAILED_PRECONDITION: it lacks Present, RANDR or colour with this many bits,
  // or a monitor does not refresh. NOT_FOUND: no such monitor; lists the available ones.
  static absl::StatusOr<std::unique_ptr<X11Display>> open(const Options& options);
  ~X11Display() override;
  X11Display(const X11Display&) = delete;
  X11Display& operator=(const X11Display&) = delete;

  std::string backend() const override { return "x11"; }
  const std::vector<ScreenInfo>& screens() const override { return screens_; }
  // UNAVAILABLE: the server went away, or a monitor has not refreshed for two seconds.
  absl::StatusOr<std::vector<Scanout>> show(const std::vector<Picture>& pictures, nanoseconds at) override;

 private:
  struct Buffer {
    xcb_pixmap_t pixmap = 0;
    Picture held;  // the content of the pixmap, if filled
    bool filled = false;
  };
  struct Refresh {
    std::uint64_t msc = 0;
    nanoseconds time{};
  };
  struct Output {
    int x = 0, y = 0;
    xcb_window_t window = 0;
    xcb_special_event_t* events = nullptr;
    std::array<Buffer, 2> buffers;
    size_t on_screen = 0;  // of buffers
    Refresh last;          // the newest known refresh
    std::uint32_t serial = 0;
  };
  struct Completion {
    Refresh refresh;
    bool skipped = false;  // never on screen
  };

  X11Display() = default;
  absl::Status connect(const Options& options);
  absl::Status find_monitors(const Options& options);
  absl::Status open_window(size_t index);
  absl::Status measure_refresh();
  void fill(Buffer& buffer, const ScreenInfo& screen, const Picture& picture);
  // Requests an event for a refresh, without showing a picture.
  void ask_for(Output& output, std::uint64_t msc);
  void present(size_t index, const Buffer& buffer, nanoseconds at);
  // Waits until every output has reported its serial, up to kPatience beyond `due`.
  absl::StatusOr<std::vector<Completion>> wait_for_all(nanoseconds due);

  xcb_connection_t* connection_ = nullptr;
  xcb_screen_t* screen_ = nullptr;
  xcb_gcontext_t context_ = 0;
  std::vector<ScreenInfo> screens_;
  std::vector<Output> outputs_;
};

}  // namespace glasswing
