#include "client/composite_video.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/composite.h"
#include "client/picture.h"
#include "client/progress.h"
#include "client/video_file.h"
#include "core/base/status.h"
#include "core/matte/compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// 0000.exr and so on, by number.
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

// Pictures into a directory, or frames of a video.
class Output {
 public:
  static absl::StatusOr<Output> create(const CompositeArguments& arguments) {
    Output output(arguments);
    if (is_video_file(arguments.output)) return output;
    std::error_code error;
    const bool names_picture = check_output(arguments.output).ok() && !fs::is_directory(arguments.output);
    if (!names_picture) fs::create_directories(arguments.output, error);
    if (names_picture || error || !fs::is_directory(arguments.output)) {
      return absl::InvalidArgumentError(
          fmt::format("the output is {}; for several mattes it must be a directory, or a video: .mp4, .mov, "
                      ".mkv, .avi or .webm",
                      arguments.output));
    }
    return output;
  }

  absl::Status add(const fs::path& matte, const RadianceImage& picture) {
    if (!is_video_file(arguments_.output)) {
      const fs::path file = fs::path(arguments_.output) / (matte.stem().string() + "." + arguments_.format);
      return write_radiance(file, picture, arguments_.encoding());
    }
    if (!video_) {
      GW_ASSIGN_OR_RETURN(video_, VideoWriter::create(arguments_.output, picture.width_px, picture.height_px,
                                                      arguments_.frame_rate_hz));
    }
    return video_->add(picture);
  }

 private:
  explicit Output(const CompositeArguments& arguments) : arguments_(arguments) {}

  const CompositeArguments& arguments_;
  std::optional<VideoWriter> video_;
};

bool same_monitors(const v1::MatteMetadata& a, const v1::MatteMetadata& b) {
  return std::ranges::equal(a.monitors(), b.monitors(), [](const v1::Monitor& m, const v1::Monitor& n) {
    return m.name() == n.name() && m.width_px() == n.width_px() && m.height_px() == n.height_px();
  });
}

absl::Status composite_all(const std::vector<fs::path>& files, const CompositeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(Output output, Output::create(arguments));
  std::optional<Backgrounds> backgrounds;
  v1::MatteMetadata first;
  Progress progress("compositing");
  for (size_t i = 0; i < files.size(); ++i) {
    GW_ASSIGN_OR_RETURN(Matte matte, read_matte(files[i]));
    brighten_foreground(matte, arguments.foreground_gain);
    if (!backgrounds) {
      first = matte.metadata;
      GW_ASSIGN_OR_RETURN(backgrounds, Backgrounds::open(arguments.backgrounds, arguments.matches, first,
                                                         arguments.encoding()));
    } else if (!same_monitors(first, matte.metadata)) {
      return absl::InvalidArgumentError(
          fmt::format("{} is of other monitors than {}; they are not of one video", files[i].string(),
                      files[0].string()));
    }
    GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backgrounds->next());
    GW_ASSIGN_OR_RETURN(const RadianceImage whole, composite(matte, *behind));
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, cropped(whole, arguments.crop));
    GW_RETURN_IF_ERROR(output.add(files[i], picture));
    progress.update(static_cast<double>(i + 1) / static_cast<double>(files.size()),
                    fmt::format("{} of {} frames", i + 1, files.size()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status composite_video(const Client& client, const CompositeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::vector<fs::path> files, mattes_in(arguments.matte));
  GW_RETURN_IF_ERROR(composite_all(files, arguments));
  if (client.json) {
    const nlohmann::ordered_json written = {{"output", arguments.output}, {"frames", files.size()}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {} frames\n", arguments.output, files.size());
  }
  return absl::OkStatus();
}

}  // namespace glasswing
