// Where live composites go: a window, a stream of video, or numbered pictures.
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
  // r, g, b by rows, 8 bit sRGB, of the size it was opened with. Returns when it was handed over.
  virtual absl::Status show(std::span<const std::uint8_t> picture) = 0;
  // Somebody closed it.
  virtual bool is_closed() { return false; }
};

// What `--output` says: "window" (X11; Escape, q or its frame closes it), "-" (standard output) or FILE
// (YUV4MPEG2, 4:4:4, which ffplay and ffmpeg read), DIR/ (000000.png, 000001.png, ...).
class LiveTarget {
 public:
  // Before anything is shown. UNAVAILABLE: there is no X display, or a file that cannot be written.
  static absl::StatusOr<LiveTarget> create(const std::string& output);
  bool takes_standard_output() const { return output_ == "-"; }
  // Once the size is known. `frame_rate_hz` stands in a stream's header.
  absl::StatusOr<std::unique_ptr<LiveOutput>> open(int width_px, int height_px, double frame_rate_hz) const;

 private:
  std::string output_;
};

}  // namespace glasswing
