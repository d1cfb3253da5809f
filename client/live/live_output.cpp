#include "client/live/live_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "client/live/live_window.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct Close {
  void operator()(std::FILE* file) const {
    if (file != stdout) std::fclose(file);
  }
};
using File = std::unique_ptr<std::FILE, Close>;

// https://wiki.multimedia.cx/index.php/YUV4MPEG2, with the colours of ITU-R BT.601, range 16 to 235.
class VideoStream final : public LiveOutput {
 public:
  VideoStream(std::string output, File file, int width_px, int height_px)
      : output_(std::move(output)),
        file_(std::move(file)),
        pixels_(static_cast<size_t>(width_px) * height_px),
        planes_(3 * pixels_) {}
  absl::Status begin(int width_px, int height_px, double frame_rate_hz) {
    return write(fmt::format("YUV4MPEG2 W{} H{} F{}:1000 Ip A1:1 C444\n", width_px, height_px,
                             std::lround(1000.0 * frame_rate_hz)));
  }
  absl::Status show(std::span<const std::uint8_t> picture) override {
    const auto part = [](int weighted, int zero) {
      return static_cast<std::uint8_t>(((weighted + 128) >> 8) + zero);
    };
    for (size_t i = 0; i < pixels_; ++i) {
      const int r = picture[3 * i], g = picture[3 * i + 1], b = picture[3 * i + 2];
      planes_[i] = part(66 * r + 129 * g + 25 * b, 16);
      planes_[pixels_ + i] = part(-38 * r - 74 * g + 112 * b, 128);
      planes_[2 * pixels_ + i] = part(112 * r - 94 * g - 18 * b, 128);
    }
    GW_RETURN_IF_ERROR(write("FRAME\n"));
    return write({reinterpret_cast<const char*>(planes_.data()), planes_.size()});
  }

 private:
  absl::Status write(std::string_view bytes) {
    const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size() &&
                         std::fflush(file_.get()) == 0;
    return written ? absl::OkStatus() : cannot_write(output_);
  }

  const std::string output_;
  File file_;
  const size_t pixels_;
  std::vector<std::uint8_t> planes_;
};

class Pictures final : public LiveOutput {
 public:
  Pictures(fs::path directory, int width_px, int height_px)
      : directory_(std::move(directory)), width_px_(width_px), height_px_(height_px) {}
  absl::Status show(std::span<const std::uint8_t> picture) override {
    return write_srgb8(directory_ / fmt::format("{:06}.png", count_++), picture, width_px_, height_px_);
  }

 private:
  const fs::path directory_;
  const int width_px_, height_px_;
  int count_ = 0;
};

}  // namespace

absl::StatusOr<LiveTarget> LiveTarget::create(const std::string& output) {
  LiveTarget target;
  target.output_ = output;
  if (output == "window") GW_RETURN_IF_ERROR(LiveWindow::check_display());
  if (!output.ends_with('/')) return target;
  std::error_code error;
  fs::create_directories(output, error);
  if (error) return cannot_write(output);
  return target;
}

absl::StatusOr<std::unique_ptr<LiveOutput>> LiveTarget::open(int width_px, int height_px,
                                                             double frame_rate_hz) const {
  if (output_ == "window") return LiveWindow::open(width_px, height_px);
  if (output_.ends_with('/')) return std::make_unique<Pictures>(output_, width_px, height_px);
  File file(output_ == kStandardOutput ? stdout : std::fopen(output_.c_str(), "wb"));
  if (file == nullptr) return cannot_write(output_);
  auto stream = std::make_unique<VideoStream>(output_, std::move(file), width_px, height_px);
  GW_RETURN_IF_ERROR(stream->begin(width_px, height_px, frame_rate_hz));
  return stream;
}

}  // namespace glasswing
