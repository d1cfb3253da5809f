// Outputs for live composites: a window, a stream of video, or numbered pictures.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace glasswing {

class LiveOutput {
 public:
  virtual ~LiveOutput() = default;
  // `picture`: r, g, b by rows, 8 bit sRGB, of the size given to open(). Returns once it has been delivered.
  virtual absl::Status show(std::span<const std::uint8_t> picture) = 0;
  // The viewer closed the output.
  virtual bool is_closed() { return false; }
};

// The argument of --output: "window" (X11; closed by Escape, q or the window manager), "-" (standard output)
// or FILE (YUV4MPEG2, 4:4:4, for ffplay and ffmpeg), or DIR/ (000000.png, 000001.png, ...).
class LiveTarget {
 public:
  // Checks the output before any work. UNAVAILABLE: there is no X display, or the directory cannot be
  // created.
  static absl::StatusOr<LiveTarget> create(const std::string& output);
  // Call when the size is known. `frame_rate_hz` goes into a stream's header.
  absl::StatusOr<std::unique_ptr<LiveOutput>> open(int width_px, int height_px, double frame_rate_hz) const;

 private:
  std::string output_;
};

}  // namespace glasswing
