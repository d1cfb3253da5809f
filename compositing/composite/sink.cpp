#include "compositing/composite/sink.h"

#include <fmt/format.h>

#include <filesystem>

#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"

namespace glasswing {

namespace fs = std::filesystem;

absl::StatusOr<Sink> Sink::create(const CompositeArguments& arguments) {
  Sink sink(arguments);
  GW_ASSIGN_OR_RETURN(sink.colours_, PictureColours::open(arguments.colours));
  if (is_video_output(arguments.output)) {
    if (sink.colours_.writes()) {
      return absl::InvalidArgumentError(fmt::format(
          "{} is a video, which is sRGB; --ocio and --ocio-out apply to pictures", arguments.output));
    }
    if (arguments.object) {
      return absl::InvalidArgumentError(fmt::format(
          "{} is a video, which has no alpha; --object needs pictures: a directory, with --format "
          "exr or png",
          arguments.output));
    }
    if (arguments.bits != 0 && arguments.bits != 8) {
      return absl::InvalidArgumentError(
          fmt::format("--bits is {}; a video has 8, a directory of pictures may have more", arguments.bits));
    }
    GW_RETURN_IF_ERROR(check_writable(arguments.output));
    return sink;
  }
  GW_RETURN_IF_ERROR(check_picture_file("a picture." + arguments.format, arguments.bits, arguments.object));
  std::error_code error;
  const bool names_picture = arguments.output == kStandardOutput || check_output(arguments.output).ok();
  if (!names_picture) fs::create_directories(arguments.output, error);
  if (names_picture || error || !fs::is_directory(arguments.output)) {
    return absl::InvalidArgumentError(
        fmt::format("the output is {}; for several pictures it must be a directory, or a video: {}",
                    arguments.output, kVideoSuffixes));
  }
  return sink;
}

absl::Status Sink::add(const std::string& name, const ObjectPicture& made, const PictureColour& colour) {
  const RadianceImage& picture = made.light;
  if (!is_video_output(arguments_.output)) {
    const fs::path file = fs::path(arguments_.output) / (name + "." + arguments_.format);
    return colours_.write(file, picture, arguments_.encoding(), arguments_.bits, colour, made.alpha());
  }
  if (!video_) {
    GW_ASSIGN_OR_RETURN(VideoWriter video, VideoWriter::create(arguments_.output, picture.width_px,
                                                               picture.height_px, arguments_.frame_rate_hz));
    video_.emplace(std::move(video));
  }
  return video_->add(picture);
}
absl::Status Sink::finish() {
  return video_ ? video_->finish() : absl::OkStatus();
}

}  // namespace glasswing
