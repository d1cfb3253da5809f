#include "client/pictures/video_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

#include "core/base/file.h"
#include "core/frame/image_file.h"

namespace glasswing {
namespace {

struct Container {
  std::string_view suffix;
  std::array<char, 4> codec;
};
constexpr std::array<Container, 5> kContainers{{{".mp4", {'m', 'p', '4', 'v'}},
                                                {".mov", {'m', 'p', '4', 'v'}},
                                                {".mkv", {'m', 'p', '4', 'v'}},
                                                {".avi", {'M', 'J', 'P', 'G'}},
                                                {".webm", {'V', 'P', '8', '0'}}}};

const Container* container_of(const std::filesystem::path& path) {
  const auto found = std::ranges::find(kContainers, path.extension().string(), &Container::suffix);
  return found == kContainers.end() ? nullptr : &*found;
}

}  // namespace

bool is_video_file(const std::filesystem::path& path) {
  return container_of(path) != nullptr;
}

absl::StatusOr<VideoReader> VideoReader::open(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    return absl::NotFoundError(fmt::format("{}: no such file", path.string()));
  // Silences OpenCV's own messages; we report errors ourselves.
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  VideoReader reader;
  // Only FFmpeg: the backends that OpenCV tries next write to the terminal.
  const int decoder =
      cv::videoio_registry::hasBackend(cv::CAP_FFMPEG) ? int{cv::CAP_FFMPEG} : int{cv::CAP_ANY};
  reader.capture_ = std::make_shared<cv::VideoCapture>(path.string(), decoder);
  if (!reader.capture_->isOpened())
    return absl::DataLossError(
        fmt::format("{}: it is damaged or no video that can be decoded", path.string()));
  const double rate = reader.capture_->get(cv::CAP_PROP_FPS),
               count = reader.capture_->get(cv::CAP_PROP_FRAME_COUNT);
  reader.frame_rate_hz_ = std::isfinite(rate) && rate > 0.0 ? rate : 0.0;
  reader.announced_frames_ = count > 0.0 && count < 1e9 ? static_cast<int>(count) : 0;
  return reader;
}

std::optional<Image16> VideoReader::next() {
  cv::Mat frame;
  if (!capture_->read(frame) || frame.empty() || frame.type() != CV_8UC3) return std::nullopt;
  Image16 image(frame.cols, frame.rows);
  for (int y = 0; y < frame.rows; ++y) {
    const cv::Vec3b* row = frame.ptr<cv::Vec3b>(y);
    for (int x = 0; x < frame.cols; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = static_cast<std::uint16_t>(row[x][2 - c] * 257);
    }
  }
  return image;
}

absl::StatusOr<VideoWriter> VideoWriter::create(const std::filesystem::path& path, int width_px,
                                                int height_px, double frame_rate_hz) {
  const Container* container = container_of(path);
  if (container == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("the video is {}; its name must end in .mp4, .mov, .mkv, .avi or .webm", path.string()));
  }
  const auto& codec = container->codec;
  VideoWriter writer;
  writer.path_ = path;
  writer.width_px_ = width_px;
  writer.height_px_ = height_px;
  // OpenCV chooses the container by the suffix.
  writer.partial_ = path.parent_path() / fmt::format("{}.partial-{}{}", path.stem().string(), ::getpid(),
                                                     path.extension().string());
  writer.writer_ = std::make_unique<cv::VideoWriter>(
      writer.partial_.string(), cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]),
      frame_rate_hz, cv::Size(width_px, height_px));
  if (!writer.writer_->isOpened()) {
    return absl::InvalidArgumentError(
        fmt::format("{} cannot be written; pictures can: give a directory", path.string()));
  }
  return writer;
}

absl::Status VideoWriter::add(const RadianceImage& picture) {
  if (picture.width_px != width_px_ || picture.height_px != height_px_) {
    return absl::InvalidArgumentError(fmt::format("a picture is {}x{}; the video {} is {}x{}",
                                                  picture.width_px, picture.height_px, path_.string(),
                                                  width_px_, height_px_));
  }
  cv::Mat frame(height_px_, width_px_, CV_8UC3);
  for (int y = 0; y < height_px_; ++y) {
    cv::Vec3b* row = frame.ptr<cv::Vec3b>(y);
    for (int x = 0; x < width_px_; ++x) {
      for (int c = 0; c < 3; ++c)
        row[x][2 - c] = cv::saturate_cast<uchar>(255.0f * srgb_of_linear(picture.at(x, y, c)));
    }
  }
  writer_->write(frame);
  return absl::OkStatus();
}

VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;

absl::Status VideoWriter::finish() {
  writer_->release();
  writer_.reset();
  return place_file_durably(partial_, path_);
}

VideoWriter::~VideoWriter() {
  if (!writer_) return;
  writer_->release();
  std::error_code ignored;
  std::filesystem::remove(partial_, ignored);
}

}  // namespace glasswing
