#include "client/pictures/composite_video.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/output_file.h"
#include "client/cli/progress.h"
#include "client/pictures/picture.h"
#include "client/pictures/video_file.h"
#include "core/base/file.h"
#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/footprint/composite_error.h"
#include "core/matte/matte_notes.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// 0000.exr, 0001.exr, ..., sorted by number.
absl::StatusOr<std::vector<fs::path>> mattes_in(const fs::path& directory) {
  std::vector<fs::path> mattes;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, error)) {
    const std::string stem = entry.path().stem().string();
    const bool numbered = !stem.empty() && stem.find_first_not_of("0123456789") == std::string::npos;
    if (numbered && entry.path().extension() == ".exr") mattes.push_back(entry.path());
  }
  if (mattes.empty()) {
    return absl::NotFoundError(fmt::format(
        "{}: it holds no mattes, 0000.exr and so on, as glasswing fetch VIDEO -o DIR/ writes them",
        directory.string()));
  }
  std::ranges::sort(mattes, [](const fs::path& a, const fs::path& b) {
    const std::string left = a.stem().string(), right = b.stem().string();
    return left.size() != right.size() ? left.size() < right.size() : left < right;
  });
  return mattes;
}

// Writes pictures into a directory, or frames of a video.
class Output {
 public:
  static absl::StatusOr<Output> create(const CompositeArguments& arguments) {
    Output output(arguments);
    GW_ASSIGN_OR_RETURN(output.colours_, PictureColours::open(arguments.colours));
    if (is_video_output(arguments.output)) {
      if (output.colours_.writes()) {
        return absl::InvalidArgumentError(fmt::format(
            "{} is a video, which is sRGB; --ocio and --ocio-out are of pictures", arguments.output));
      }
      if (arguments.object) {
        return absl::InvalidArgumentError(
            fmt::format("{} is a video, which has no alpha; --object is of pictures: a directory, with "
                        "--format exr or png",
                        arguments.output));
      }
      if (arguments.bits != 0 && arguments.bits != 8) {
        return absl::InvalidArgumentError(fmt::format(
            "--bits is {}; a video has 8, a directory of pictures may have more", arguments.bits));
      }
      GW_RETURN_IF_ERROR(check_writable(arguments.output));
      return output;
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
    return output;
  }

  const PictureColours& colours() const { return colours_; }

  absl::Status add(const std::string& name, const ObjectPicture& made, const PictureColour& colour) {
    const RadianceImage& picture = made.light;
    if (!is_video_output(arguments_.output)) {
      const fs::path file = fs::path(arguments_.output) / (name + "." + arguments_.format);
      return colours_.write(file, picture, arguments_.encoding(), arguments_.bits, colour, made.alpha());
    }
    if (!video_) {
      GW_ASSIGN_OR_RETURN(VideoWriter video,
                          VideoWriter::create(arguments_.output, picture.width_px, picture.height_px,
                                              arguments_.frame_rate_hz));
      video_.emplace(std::move(video));
    }
    return video_->add(picture);
  }
  absl::Status finish() { return video_ ? video_->finish() : absl::OkStatus(); }

 private:
  explicit Output(const CompositeArguments& arguments) : arguments_(arguments) {}

  const CompositeArguments& arguments_;
  PictureColours colours_;
  std::optional<VideoWriter> video_;
};

bool same_monitors(const v1::MatteMetadata& a, const v1::MatteMetadata& b) {
  return std::ranges::equal(a.monitors(), b.monitors(), [](const v1::Monitor& m, const v1::Monitor& n) {
    return m.name() == n.name() && m.width_px() == n.width_px() && m.height_px() == n.height_px();
  });
}

struct Composited {
  int frames = 0;
  std::vector<std::string> warnings;  // of the mattes
  PixelCount pixels;

  void note(const ObjectInFront& object) {
    note_warnings(object.metadata(), warnings);
    pixels += object.pixels();
  }
};

absl::StatusOr<Composited> composite_mattes(const CompositeArguments& arguments) {
  if (arguments.frame_count > 0) {
    return absl::InvalidArgumentError(
        fmt::format("--frames is for one matte; {} holds a matte for each frame", arguments.matte));
  }
  GW_ASSIGN_OR_RETURN(const std::vector<fs::path> files, mattes_in(arguments.matte));
  GW_ASSIGN_OR_RETURN(Output output, Output::create(arguments));
  std::optional<Backgrounds> backgrounds;
  v1::MatteMetadata first;
  Composited made{.frames = static_cast<int>(files.size()), .warnings = {}, .pixels = {}};
  Progress progress("compositing");
  for (size_t i = 0; i < files.size(); ++i) {
    GW_ASSIGN_OR_RETURN(ObjectInFront object,
                        ObjectInFront::create(files[i], arguments, ObjectInFront::Pictures::kOne));
    if (!backgrounds) {
      first = object.metadata();
      GW_ASSIGN_OR_RETURN(backgrounds, Backgrounds::open(arguments.backgrounds, first, output.colours(),
                                                         arguments.encoding()));
    } else if (!same_monitors(first, object.metadata())) {
      return absl::InvalidArgumentError(fmt::format(
          "{} has other monitors than {}; they are not of one video", files[i].string(), files[0].string()));
    }
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backgrounds->next());
    GW_ASSIGN_OR_RETURN(const ObjectPicture picture, object.composite(*behind));
    GW_RETURN_IF_ERROR(output.add(files[i].stem().string(), picture, backgrounds->colour_of_composite()));
    made.note(object);
    progress.update(static_cast<double>(i + 1) / static_cast<double>(files.size()),
                    fmt::format("{} of {} frames", i + 1, files.size()));
  }
  GW_RETURN_IF_ERROR(output.finish());
  return made;
}

absl::StatusOr<Composited> composite_one_matte(const CompositeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(Output output, Output::create(arguments));
  Progress progress("compositing");
  GW_ASSIGN_OR_RETURN(ObjectInFront object,
                      ObjectInFront::create(arguments.matte, arguments, ObjectInFront::Pictures::kMany));
  GW_ASSIGN_OR_RETURN(Backgrounds backgrounds, Backgrounds::open(arguments.backgrounds, object.metadata(),
                                                                 output.colours(), arguments.encoding()));
  if (arguments.frame_count == 0 && !backgrounds.has_video()) {
    return absl::InvalidArgumentError(
        "--frames is not given; it must give the number of pictures unless a --background is a video or a "
        "directory of pictures");
  }
  int count = 0;
  for (; arguments.frame_count == 0 || count < arguments.frame_count; ++count) {
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backgrounds.next());
    if (arguments.frame_count == 0 && backgrounds.is_over()) break;
    GW_ASSIGN_OR_RETURN(const ObjectPicture picture, object.composite(*behind));
    GW_RETURN_IF_ERROR(output.add(fmt::format("{:04d}", count), picture, backgrounds.colour_of_composite()));
    const double all = arguments.frame_count > 0 ? arguments.frame_count : backgrounds.announced_frames();
    progress.update(all > 0.0 ? std::min((count + 1) / all, 1.0) : 0.0, fmt::format("{} frames", count + 1));
  }
  GW_RETURN_IF_ERROR(output.finish());
  Composited made{.frames = count, .warnings = {}, .pixels = {}};
  made.note(object);
  return made;
}

}  // namespace

ObjectInFront::ObjectInFront(std::string file, std::shared_ptr<const MappedFile> mapped, MatteOutline outline,
                             const CompositeArguments& arguments)
    : file_(std::move(file)),
      mapped_(std::move(mapped)),
      outline_(std::move(outline)),
      crop_(arguments.crop),
      fill_(arguments.fill),
      foreground_gain_(arguments.foreground_gain),
      unsolved_(static_cast<size_t>(outline_.width_px) * static_cast<size_t>(outline_.height_px)) {
  if (arguments.object) coverage_ = RadianceImage(outline_.width_px, outline_.height_px, 1);
}

absl::StatusOr<ObjectInFront> ObjectInFront::create(const fs::path& file, const CompositeArguments& arguments,
                                                    Pictures pictures) {
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> mapped, MappedFile::open(file));
  absl::StatusOr<MatteOutline> outline = outline_of(mapped->bytes());
  if (!outline.ok()) return in_file(file.string(), outline.status());
  ObjectInFront object(file.string(), std::move(mapped), *std::move(outline), arguments);
  GW_RETURN_IF_ERROR(in_file(object.file_, object.prepare(pictures, arguments.exact)));
  return object;
}

absl::Status ObjectInFront::prepare(Pictures pictures, bool exact) {
  if (exact) {
    GW_ASSIGN_OR_RETURN(exact_, decode_matte(mapped_->bytes()));
    take(*exact_);
  } else if (pictures == Pictures::kMany) {
    GW_ASSIGN_OR_RETURN(many_, FastCompositor::create(mapped_->bytes(), [this](Matte& rows) { take(rows); }));
  }
  return absl::OkStatus();
}

void ObjectInFront::take(Matte& rows) {
  const int top = rows.y0_px() - outline_.y0_px;
  note_unsolved(rows, top, unsolved_);
  {
    const PixelCount count = count_pixels(rows);
    const std::lock_guard lock(counted_->mutex);
    counted_->pixels += count;
  }
  for (int y = 0; y < rows.height_px(); ++y) {
    for (int x = 0; x < rows.width_px(); ++x) {
      if (!coverage_.empty()) coverage_.at(x, top + y, 0) = rows.coverage(x, y);
      for (float& light : rows.foreground(x, y)) light *= foreground_gain_;
    }
  }
}

absl::StatusOr<RadianceImage> ObjectInFront::composite_whole(const std::vector<RadianceImage>& backgrounds,
                                                             const std::function<void(double)>& progress) {
  if (exact_) return glasswing::composite(*exact_, backgrounds, 0, progress);
  if (many_) return many_->composite(backgrounds);
  absl::StatusOr<RadianceImage> made = composite_file(
      mapped_->bytes(), backgrounds, [this](Matte& rows) { take(rows); }, 0, progress);
  if (!made.ok()) return in_file(file_, made.status());
  return made;
}

absl::StatusOr<ObjectPicture> ObjectInFront::composite(const std::vector<RadianceImage>& backgrounds,
                                                       const std::function<void(double)>& progress) {
  ObjectPicture made;
  GW_ASSIGN_OR_RETURN(RadianceImage whole, composite_whole(backgrounds, progress));
  if (fill_) fill_unsolved(unsolved_, whole);
  GW_ASSIGN_OR_RETURN(made.light, cropped(whole, crop_));
  if (!coverage_.empty()) {
    GW_ASSIGN_OR_RETURN(made.coverage, cropped(coverage_, crop_));
  }
  return made;
}

absl::StatusOr<RadianceImage> ObjectInFront::error(const std::vector<RadianceImage>& backgrounds,
                                                   const std::function<void(double)>& progress) const {
  GW_ASSIGN_OR_RETURN(const Matte matte, decode_matte(mapped_->bytes()));
  GW_ASSIGN_OR_RETURN(const RadianceImage whole, composite_error(matte, backgrounds, 0, progress));
  return cropped(whole, crop_);
}

bool is_video(const CompositeArguments& arguments) {
  const fs::path output = arguments.output;
  return fs::is_directory(arguments.matte) || fs::is_directory(output) || is_video_output(output) ||
         (!output.has_extension() && output != kStandardOutput) || arguments.frame_count > 0;
}

absl::Status composite_video(const Client& client, const CompositeArguments& arguments) {
  if (!arguments.error.empty()) {
    return absl::InvalidArgumentError(
        "--error is of one picture; composite a single frame's matte over stills");
  }
  GW_ASSIGN_OR_RETURN(const Composited made, fs::is_directory(arguments.matte)
                                                 ? composite_mattes(arguments)
                                                 : composite_one_matte(arguments));
  print_warnings(made.warnings);
  if (client.json) {
    nlohmann::ordered_json written = {
        {"output", arguments.output}, {"frames", made.frames}, {"filled", arguments.fill}};
    add_notes(made.warnings, made.pixels, written);
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format(
        "{}: {} frames{}\n", arguments.output, made.frames,
        arguments.fill ? ", pixels that are not solved filled from their neighbours" : "");
    print_flagged(made.pixels);
  }
  return absl::OkStatus();
}

}  // namespace glasswing
