#include "compositing/picture/video_file.h"

#include <fmt/format.h>
#include <unistd.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>

#include "compositing/picture/video_codecs.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

struct Container {
  std::string_view suffix;
  std::array<char, 4> codec;
};
constexpr std::array<Container, 5> kContainers{{{".mp4", {'a', 'v', 'c', '1'}},
                                                {".mov", {'a', 'v', 'c', '1'}},
                                                {".mkv", {'a', 'v', 'c', '1'}},
                                                {".avi", {'M', 'J', 'P', 'G'}},
                                                {".webm", {'V', 'P', '8', '0'}}}};

const Container* container_of(const std::filesystem::path& path) {
  const auto found = std::ranges::find(kContainers, path.extension().string(), &Container::suffix);
  return found == kContainers.end() ? nullptr : &*found;
}

constexpr std::string_view kAnimation = ".webp";

}  // namespace

class VideoWriter::Encoder {
 public:
  virtual ~Encoder() = default;
  // `frame`: 8 bit, BGR. False: it cannot be encoded.
  virtual bool add(const cv::Mat& frame) = 0;
  // After the last frame. Writes what is not yet in the file.
  virtual absl::Status finish() = 0;
};

namespace {

class VideoEncoder : public VideoWriter::Encoder {
 public:
  explicit VideoEncoder(cv::VideoWriter* writer) : writer_(writer) {}
  bool is_open() const { return writer_->isOpened(); }
  bool add(const cv::Mat& frame) override {
    writer_->write(frame);
    return true;
  }
  absl::Status finish() override {
    writer_->release();
    return absl::OkStatus();
  }

 private:
  std::unique_ptr<cv::VideoWriter> writer_;
};

// A WebP that repeats forever.
class AnimationEncoder : public VideoWriter::Encoder {
 public:
  AnimationEncoder(std::filesystem::path file, cv::Size size, double frame_rate_hz)
      : file_(std::move(file)), frame_rate_hz_(frame_rate_hz) {
    WebPAnimEncoderOptions options;
    if (!WebPAnimEncoderOptionsInit(&options) || !WebPConfigInit(&config_)) return;
    config_.quality = 85.0f;
    encoder_.reset(WebPAnimEncoderNew(size.width, size.height, &options));
  }
  bool is_open() const { return encoder_ != nullptr; }
  bool add(const cv::Mat& frame) override {
    WebPPicture picture;
    if (!WebPPictureInit(&picture)) return false;
    picture.use_argb = 1;
    picture.width = frame.cols;
    picture.height = frame.rows;
    const bool added = WebPPictureImportBGR(&picture, frame.data, static_cast<int>(frame.step)) &&
                       WebPAnimEncoderAdd(encoder_.get(), &picture, time_ms(count_), &config_);
    WebPPictureFree(&picture);
    ++count_;
    return added;
  }
  absl::Status finish() override {
    WebPData data;
    WebPDataInit(&data);
    const bool assembled = WebPAnimEncoderAdd(encoder_.get(), nullptr, time_ms(count_), nullptr) &&
                           WebPAnimEncoderAssemble(encoder_.get(), &data);
    const absl::Status written =
        assembled ? write_file_durably(file_, {reinterpret_cast<const char*>(data.bytes), data.size})
                  : absl::InternalError(WebPAnimEncoderGetError(encoder_.get()));
    WebPDataClear(&data);
    return written;
  }

 private:
  int time_ms(int frame) const { return static_cast<int>(std::lround(1000.0 * frame / frame_rate_hz_)); }

  std::filesystem::path file_;
  double frame_rate_hz_;
  WebPConfig config_{};
  int count_ = 0;
  struct Delete {
    void operator()(WebPAnimEncoder* encoder) const { WebPAnimEncoderDelete(encoder); }
  };
  std::unique_ptr<WebPAnimEncoder, Delete> encoder_;
};

// Null: this file cannot be written.
absl::StatusOr<std::unique_ptr<VideoWriter::Encoder>> encoder_of(const std::filesystem::path& file,
                                                                 cv::Size size, double frame_rate_hz) {
  const Container* container = container_of(file);
  if (container == nullptr) {
    auto animation = std::make_unique<AnimationEncoder>(file, size, frame_rate_hz);
    if (!animation->is_open()) return nullptr;
    return animation;
  }
  GW_ASSIGN_OR_RETURN(const VideoCodecs* codecs, video_codecs());
  auto video =
      std::make_unique<VideoEncoder>(codecs->writer(file.string(), container->codec, frame_rate_hz, size));
  if (!video->is_open()) return nullptr;
  return video;
}

}  // namespace

bool is_video_file(const std::filesystem::path& path) {
  return container_of(path) != nullptr;
}

bool is_video_output(const std::filesystem::path& path) {
  return is_video_file(path) || path.extension() == kAnimation;
}

absl::StatusOr<VideoReader> VideoReader::open(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    return absl::NotFoundError(fmt::format("{}: no such file", path.string()));
  GW_ASSIGN_OR_RETURN(const VideoCodecs* codecs, video_codecs());
  // Silences OpenCV's own messages; we report errors ourselves.
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  VideoReader reader;
  reader.capture_.reset(codecs->reader(path.string()));
  if (!reader.capture_->isOpened())
    return absl::DataLossError(fmt::format("{}: it is damaged or not a decodable video", path.string()));
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
  if (!is_video_output(path)) {
    return absl::InvalidArgumentError(
        fmt::format("the video is {}; its name must end in {}", path.string(), kVideoSuffixes));
  }
  VideoWriter writer;
  writer.path_ = path;
  writer.width_px_ = width_px;
  writer.height_px_ = height_px;
  // OpenCV chooses the container by the suffix.
  writer.partial_ = path.parent_path() / fmt::format("{}.partial-{}{}", path.stem().string(), ::getpid(),
                                                     path.extension().string());
  GW_ASSIGN_OR_RETURN(writer.encoder_, encoder_of(writer.partial_, {width_px, height_px}, frame_rate_hz));
  if (!writer.encoder_) {
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
  if (!encoder_->add(frame))
    return absl::InternalError(fmt::format("{}: a frame cannot be encoded", path_.string()));
  return absl::OkStatus();
}

VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;

absl::Status VideoWriter::finish() {
  GW_RETURN_IF_ERROR(encoder_->finish());
  encoder_.reset();
  return place_file_durably(partial_, path_);
}

VideoWriter::~VideoWriter() {
  if (!encoder_) return;
  encoder_.reset();
  std::error_code ignored;
  std::filesystem::remove(partial_, ignored);
}

}  // namespace glasswing
