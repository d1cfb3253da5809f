#include "compositing/composite/sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "compositing/composite/backdrop.h"
#include "compositing/composite/object.h"
#include "compositing/composite/sink.h"
#include "compositing/picture/video_file.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
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
        "{}: it contains no mattes, 0000.exr and so on, as glasswing fetch VIDEO -o DIR/ writes them",
        directory.string()));
  }
  std::ranges::sort(mattes, [](const fs::path& a, const fs::path& b) {
    const std::string left = a.stem().string(), right = b.stem().string();
    return left.size() != right.size() ? left.size() < right.size() : left < right;
  });
  return mattes;
}

bool same_monitors(const v1::MatteMetadata& a, const v1::MatteMetadata& b) {
  return std::ranges::equal(a.monitors(), b.monitors(), [](const v1::Monitor& m, const v1::Monitor& n) {
    return m.name() == n.name() && m.width_px() == n.width_px() && m.height_px() == n.height_px();
  });
}

void note(const ObjectInFront& object, Composited& made) {
  note_warnings(object.metadata(), made.warnings);
  made.pixels += object.pixels();
}

absl::StatusOr<Composited> composite_mattes(const CompositeArguments& arguments) {
  if (arguments.frame_count > 0) {
    return absl::InvalidArgumentError(
        fmt::format("--frames is for one matte; {} contains a matte for each frame", arguments.matte));
  }
  GW_ASSIGN_OR_RETURN(const std::vector<fs::path> files, mattes_in(arguments.matte));
  GW_ASSIGN_OR_RETURN(Sink sink, Sink::create(arguments));
  std::optional<Backdrop> backdrop;
  Composited made{.frames = static_cast<int>(files.size()), .warnings = {}, .pixels = {}};
  v1::MatteMetadata first;
  Progress progress("compositing");
  for (size_t i = 0; i < files.size(); ++i) {
    GW_ASSIGN_OR_RETURN(ObjectInFront object,
                        ObjectInFront::create(files[i], arguments, ObjectInFront::Pictures::kOne));
    if (!backdrop) {
      first = object.metadata();
      GW_ASSIGN_OR_RETURN(backdrop,
                          Backdrop::open(arguments.backgrounds, first, sink.colours(), arguments.encoding()));
    } else if (!same_monitors(first, object.metadata())) {
      return absl::InvalidArgumentError(
          fmt::format("{} has different monitors from {}; they do not belong to one video", files[i].string(),
                      files[0].string()));
    }
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backdrop->next());
    GW_ASSIGN_OR_RETURN(const ObjectPicture picture, object.composite(*behind));
    note(object, made);
    GW_RETURN_IF_ERROR(sink.add(files[i].stem().string(), picture, backdrop->colour_of_composite()));
    progress.update(static_cast<double>(i + 1) / static_cast<double>(files.size()),
                    fmt::format("{} of {} frames", i + 1, files.size()));
  }
  GW_RETURN_IF_ERROR(sink.finish());
  return made;
}

absl::StatusOr<Composited> composite_one_matte(const CompositeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(Sink sink, Sink::create(arguments));
  Progress progress("compositing");
  GW_ASSIGN_OR_RETURN(ObjectInFront object,
                      ObjectInFront::create(arguments.matte, arguments, ObjectInFront::Pictures::kMany));
  GW_ASSIGN_OR_RETURN(Backdrop backdrop, Backdrop::open(arguments.backgrounds, object.metadata(),
                                                        sink.colours(), arguments.encoding()));
  if (arguments.frame_count == 0 && !backdrop.has_video()) {
    return absl::InvalidArgumentError(
        "--frames is not given; it must give the number of pictures unless a --background is a video or a "
        "directory of pictures");
  }
  int count = 0;
  for (; arguments.frame_count == 0 || count < arguments.frame_count; ++count) {
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backdrop.next());
    if (arguments.frame_count == 0 && backdrop.is_over()) break;
    GW_ASSIGN_OR_RETURN(const ObjectPicture picture, object.composite(*behind));
    GW_RETURN_IF_ERROR(sink.add(fmt::format("{:04d}", count), picture, backdrop.colour_of_composite()));
    const double all = arguments.frame_count > 0 ? arguments.frame_count : backdrop.announced_frames();
    progress.update(all > 0.0 ? std::min((count + 1) / all, 1.0) : 0.0, fmt::format("{} frames", count + 1));
  }
  GW_RETURN_IF_ERROR(sink.finish());
  Composited made{.frames = count, .warnings = {}, .pixels = {}};
  note(object, made);
  return made;
}

}  // namespace

bool is_video(const CompositeArguments& arguments) {
  const fs::path output = arguments.output;
  return fs::is_directory(arguments.matte) || fs::is_directory(output) || is_video_output(output) ||
         (!output.has_extension() && output != kStandardOutput) || arguments.frame_count > 0;
}

absl::StatusOr<Composited> composite_sequence(const CompositeArguments& arguments) {
  if (!arguments.error.empty()) {
    return absl::InvalidArgumentError(
        "--error is for one picture; composite a single frame's matte over stills");
  }
  return fs::is_directory(arguments.matte) ? composite_mattes(arguments) : composite_one_matte(arguments);
}

}  // namespace glasswing
