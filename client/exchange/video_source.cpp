#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>

#include "client/cli/monitor_argument.h"
#include "client/exchange/frame_source.h"
#include "compositing/picture/video_file.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/photograph_response.h"
#include "core/import/sequences.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr const char* kUsualResponse = "srgb";

absl::StatusOr<v1::CaptureManifest> header_of(const VideoOptions& options) {
  const std::vector<std::string>& monitors = options.photographs.monitors;
  if (monitors.size() != 1)
    return absl::InvalidArgumentError(fmt::format(
        "--monitor is given {} times; a video needs it once, such as back:1920x1080", monitors.size()));
  v1::CaptureManifest manifest;
  manifest.set_format_version(1);
  GW_ASSIGN_OR_RETURN(*manifest.add_monitors(), parse_monitor_argument(monitors.front()));
  return manifest;
}

absl::StatusOr<PhotographResponse> response_of(const PhotographOptions& options, int bits) {
  return PhotographResponse::create(options.response.value_or(kUsualResponse),
                                    options.black.value_or(0.0) / options.white.value_or(highest_code(bits)));
}

void set_camera(int width_px, int height_px, int bits, v1::CaptureManifest& manifest) {
  v1::Camera& camera = *manifest.mutable_camera();
  camera.set_width_px(width_px);
  camera.set_height_px(height_px);
  camera.set_bits(bits);
  camera.set_response("linear");
}

void add_frame(const std::string& file, bool object, v1::CaptureManifest& manifest) {
  v1::Frame& frame = *manifest.add_frames();
  frame.set_file(file);
  frame.set_object(object);
  frame.set_step(-1);
  frame.set_proof(v1::PROOF_IMPORTED);
  frame.mutable_stimulus()->set_kind("ramp");
  frame.mutable_stimulus()->set_panel(manifest.monitors(0).name());
}

absl::Status check_likeness(const std::string& what, const Image16& image, int bits,
                            const v1::Camera& first) {
  if (image.width_px == first.width_px() && image.height_px == first.height_px() && bits == first.bits())
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is {}x{} of {} bits; it must match the first frame, {}x{} of {} bits", what,
                  image.width_px, image.height_px, bits, first.width_px(), first.height_px(), first.bits()));
}

// The frames of the empty stage must be known, and some frames must remain with the object.
absl::Status check_empty_frames(const fs::path& path, int count, const VideoOptions& options) {
  const int empty = options.empty_frames;
  if (!options.empty_directory.empty()) return absl::OkStatus();
  if (empty >= 1 && empty < count) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("--empty-frames is {}; {} has {} frames: it must be the number of leading frames of the "
                  "empty stage, 1 to {}, or --empty must name a directory of such frames",
                  empty, path.string(), count, count - 1));
}

// Pictures, each read on demand.
struct Pictures {
  std::vector<fs::path> files;
  v1::Camera camera;
  std::optional<int> white;
  PhotographResponse response;

  absl::StatusOr<Image16> read(size_t place) const {
    GW_ASSIGN_OR_RETURN(CodedPhotograph photograph, read_photograph(files[place], white));
    GW_RETURN_IF_ERROR(check_likeness(files[place].string(), photograph.codes, photograph.bits, camera));
    response.linearise(photograph.codes);
    return std::move(photograph.codes);
  }
};

absl::StatusOr<std::vector<fs::path>> empty_pictures(const VideoOptions& options) {
  std::vector<fs::path> files;
  if (options.empty_directory.empty()) return files;
  files = numbered_pictures(options.empty_directory);
  if (files.empty()) {
    return absl::NotFoundError(
        fmt::format("--empty: {} contains no pictures whose names end in a number", options.empty_directory));
  }
  return files;
}

absl::StatusOr<FrameSource> picture_source(const fs::path& directory, const VideoOptions& options) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, header_of(options));
  GW_ASSIGN_OR_RETURN(std::vector<fs::path> files, empty_pictures(options));
  const std::vector<fs::path> video = numbered_pictures(directory);
  GW_RETURN_IF_ERROR(check_empty_frames(directory, static_cast<int>(video.size()), options));
  std::vector<std::string> warnings;
  if (const std::int64_t missing = missing_numbers(video); missing > 0)
    warnings.push_back(missing_text(directory, missing));
  const size_t empty = files.empty() ? static_cast<size_t>(options.empty_frames) : files.size();
  files.insert(files.end(), video.begin(), video.end());
  GW_ASSIGN_OR_RETURN(const CodedPhotograph first, read_photograph(files.front()));
  set_camera(first.codes.width_px, first.codes.height_px, first.bits, manifest);
  for (size_t i = 0; i < files.size(); ++i) add_frame(fmt::format("{:06d}", i), i >= empty, manifest);
  GW_ASSIGN_OR_RETURN(PhotographResponse response, response_of(options.photographs, first.bits));
  GW_RETURN_IF_ERROR(check_manifest(manifest));
  const auto pictures = std::make_shared<const Pictures>(Pictures{.files = std::move(files),
                                                                  .camera = manifest.camera(),
                                                                  .white = options.photographs.white,
                                                                  .response = std::move(response)});
  return FrameSource{.manifest = std::move(manifest),
                     .read = [pictures](int frame) { return pictures->read(static_cast<size_t>(frame)); },
                     .warnings = std::move(warnings)};
}

// A video file, decoded forwards; reading an earlier frame starts again.
class Decoded {
 public:
  Decoded(fs::path path, v1::Camera camera, PhotographResponse response)
      : path_(std::move(path)), camera_(std::move(camera)), response_(std::move(response)) {}

  absl::StatusOr<Image16> read(int frame) {
    if (!reader_ || frame < next_) {
      GW_ASSIGN_OR_RETURN(VideoReader reader, VideoReader::open(path_));
      reader_.emplace(std::move(reader));
      next_ = 0;
    }
    std::optional<Image16> image;
    for (; next_ <= frame; ++next_) image = reader_->next();
    if (!image)
      return absl::DataLossError(fmt::format("{}: frame {} can no longer be decoded", path_.string(), frame));
    GW_RETURN_IF_ERROR(
        check_likeness(fmt::format("{}: frame {}", path_.string(), frame), *image, camera_.bits(), camera_));
    response_.linearise(*image);
    return *std::move(image);
  }

 private:
  const fs::path path_;
  const v1::Camera camera_;
  const PhotographResponse response_;
  std::optional<VideoReader> reader_;
  int next_ = 0;
};

absl::StatusOr<FrameSource> file_source(const fs::path& path, const VideoOptions& options) {
  constexpr int kBits = 8;
  if (options.photographs.white) {
    return absl::InvalidArgumentError(
        fmt::format("{}: --white is for photographs and directories of pictures", path.string()));
  }
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, header_of(options));
  GW_ASSIGN_OR_RETURN(std::vector<fs::path> empty, empty_pictures(options));
  GW_ASSIGN_OR_RETURN(VideoReader reader, VideoReader::open(path));
  GW_ASSIGN_OR_RETURN(PhotographResponse response, response_of(options.photographs, kBits));
  // The frame count is known only after decoding: headers can be wrong.
  int count = 0;
  Progress progress("decoding");
  for (std::optional<Image16> image; (image = reader.next()); ++count) {
    if (interrupted()) return absl::CancelledError("the import was interrupted before anything was written");
    if (count == 0) set_camera(image->width_px, image->height_px, kBits, manifest);
    GW_RETURN_IF_ERROR(
        check_likeness(fmt::format("{}: frame {}", path.string(), count), *image, kBits, manifest.camera()));
    const int announced = std::max(reader.announced_frames(), count + 1);
    progress.update((count + 1.0) / announced, fmt::format("{} frames", count + 1));
  }
  if (count == 0) return absl::DataLossError(fmt::format("{}: no frame can be decoded", path.string()));
  GW_RETURN_IF_ERROR(check_empty_frames(path, count, options));
  for (size_t i = 0; i < empty.size(); ++i) add_frame(fmt::format("empty-{:06d}", i), false, manifest);
  for (int i = 0; i < count; ++i) {
    add_frame(fmt::format("{:06d}", i), !empty.empty() || i >= options.empty_frames, manifest);
    if (reader.frame_rate_hz() > 0.0)
      manifest.mutable_frames()->rbegin()->set_exposure_start_ns(
          std::llround((i + 1) * 1e9 / reader.frame_rate_hz()));
  }
  GW_RETURN_IF_ERROR(check_manifest(manifest));
  const auto pictures = std::make_shared<const Pictures>(Pictures{
      .files = std::move(empty), .camera = manifest.camera(), .white = std::nullopt, .response = response});
  const auto decoded = std::make_shared<Decoded>(path, manifest.camera(), std::move(response));
  FrameSource source{.manifest = std::move(manifest), .read = [pictures, decoded](int frame) {
                       const int before = static_cast<int>(pictures->files.size());
                       return frame < before ? pictures->read(static_cast<size_t>(frame))
                                             : decoded->read(frame - before);
                     }};
  source.was_read = options.empty_directory.empty();
  if (count < reader.announced_frames()) {
    source.warnings.push_back(
        fmt::format("{} ends early: {} frames could be decoded, its header announces {}", path.string(),
                    count, reader.announced_frames()));
  }
  return source;
}

}  // namespace

absl::StatusOr<FrameSource> video_source(const fs::path& path, const VideoOptions& options) {
  return is_video_file(path) ? file_source(path, options) : picture_source(path, options);
}

}  // namespace glasswing
