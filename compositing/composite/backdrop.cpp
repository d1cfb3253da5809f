#include "compositing/composite/backdrop.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "compositing/picture/picture.h"
#include "compositing/picture/video_file.h"
#include "core/base/scanner.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

// "DX,DY".
absl::Status read_shift(const BackgroundArgument& argument, std::string_view option, double& dx_px,
                        double& dy_px) {
  constexpr double kFarthest_px = 1e6;
  const std::string& text = argument.file;
  const bool parsed = Scanner(text).number(dx_px).then(",").number(dy_px).done();
  if (parsed && std::abs(dx_px) <= kFarthest_px && std::abs(dy_px) <= kFarthest_px) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "{} is \"{}\"; it must be DX,DY: px of the monitor, right and down, as 12.5,-3", option, text));
}

}  // namespace

absl::StatusOr<BackgroundArgument> parse_background(const std::string& argument,
                                                    const v1::MatteMetadata& metadata,
                                                    std::string_view option) {
  const size_t equals = argument.find('=');
  if (equals == std::string::npos) return BackgroundArgument{0, argument};
  const std::string texture = argument.substr(0, equals);
  std::vector<std::string> names;
  for (int i = 0; i < metadata.monitors_size(); ++i) {
    if (metadata.monitors(i).name() == texture) return BackgroundArgument{i, argument.substr(equals + 1)};
    names.push_back(metadata.monitors(i).name());
  }
  std::error_code ignored;
  if (std::filesystem::exists(argument, ignored)) return BackgroundArgument{0, argument};
  return absl::InvalidArgumentError(fmt::format("{} names the texture \"{}\"; this matte has: {}", option,
                                                texture, fmt::join(names, ", ")));
}

absl::StatusOr<Backdrop> Backdrop::open(const BackgroundArguments& arguments,
                                        const v1::MatteMetadata& metadata, const PictureColours& colours,
                                        Encoding encoding) {
  if (metadata.monitors().empty()) return absl::DataLossError("the matte's header names no monitors");
  const auto read = [colours, encoding](const std::filesystem::path& file) {
    return colours.read(file, encoding);
  };
  Backdrop backdrop;
  backdrop.calibrated_ = std::ranges::any_of(metadata.crosstalk(),
                                             [](const v1::Crosstalk& seen) { return !seen.share().empty(); });
  for (const v1::Monitor& monitor : metadata.monitors()) {
    backdrop.screens_.emplace_back();
    backdrop.screens_.back().width_px = monitor.width_px();
    backdrop.screens_.back().height_px = monitor.height_px();
  }
  for (const std::string& argument : arguments.pictures) {
    GW_ASSIGN_OR_RETURN(const BackgroundArgument background, parse_background(argument, metadata));
    Screen& screen = backdrop.screens_[background.texture];
    if (screen.picture) {
      return absl::InvalidArgumentError(
          fmt::format("--background names the texture \"{}\" twice; each takes one picture",
                      metadata.monitors(background.texture).name()));
    }
    if (colours.reads() && is_video_file(background.file)) {
      return absl::InvalidArgumentError(
          fmt::format("--background {} is a video, which is sRGB; --ocio and --ocio-in are of pictures",
                      background.file));
    }
    GW_ASSIGN_OR_RETURN(screen.picture, MovingPicture::open(background.file, read));
    tell_layer(screen.picture->first());
    backdrop.are_rec709_ =
        backdrop.are_rec709_ && (colours.reads() || screen.picture->colour(encoding) == linear_rec709());
  }
  const auto each = [&](const std::vector<std::string>& all, std::string_view option,
                        const auto& take) -> absl::Status {
    for (const std::string& argument : all) {
      GW_ASSIGN_OR_RETURN(const BackgroundArgument named, parse_background(argument, metadata, option));
      Screen& screen = backdrop.screens_[named.texture];
      if (!screen.picture) {
        return absl::InvalidArgumentError(
            fmt::format("{} names the texture \"{}\", which has no --background", option,
                        metadata.monitors(named.texture).name()));
      }
      GW_RETURN_IF_ERROR(take(named, screen));
    }
    return absl::OkStatus();
  };
  GW_RETURN_IF_ERROR(each(arguments.matches, "--match",
                          [&](const BackgroundArgument& match, Screen& screen) -> absl::Status {
                            GW_ASSIGN_OR_RETURN(screen.photograph, read(match.file));
                            return absl::OkStatus();
                          }));
  GW_RETURN_IF_ERROR(each(arguments.shifts, "--shift", [](const BackgroundArgument& shift, Screen& screen) {
    return read_shift(shift, "--shift", screen.dx_px, screen.dy_px);
  }));
  GW_RETURN_IF_ERROR(each(arguments.pans, "--pan", [](const BackgroundArgument& pan, Screen& screen) {
    return read_shift(pan, "--pan", screen.pan_x_px, screen.pan_y_px);
  }));
  backdrop.wraps_ = arguments.wraps;
  backdrop.now_.resize(backdrop.screens_.size());
  return backdrop;
}

absl::StatusOr<const std::vector<RadianceImage>*> Backdrop::next() {
  for (size_t t = 0; t < screens_.size(); ++t) {
    Screen& screen = screens_[t];
    if (!screen.picture) continue;
    const bool moves = screen.pan_x_px != 0.0 || screen.pan_y_px != 0.0;
    const bool is_new = !screen.picture->is_still() || screen.placed.empty();
    if (!is_new && !moves) continue;
    if (is_new) {
      GW_ASSIGN_OR_RETURN(const RadianceImage picture, screen.picture->next());
      screen.placed = resized(picture, screen.width_px, screen.height_px);
      // Learnt from a video's first picture only: matching each one would flicker.
      if (!screen.photograph.empty() && !screen.match) {
        GW_ASSIGN_OR_RETURN(screen.match, HistogramMatch::learn(screen.placed, screen.photograph));
      }
      if (screen.match) screen.match->apply(screen.placed);
    }
    now_[t] = shifted(screen.placed, screen.dx_px, screen.dy_px, wraps_);
    screen.dx_px += screen.pan_x_px;
    screen.dy_px += screen.pan_y_px;
  }
  return &now_;
}

bool Backdrop::has_video() const {
  return std::ranges::any_of(
      screens_, [](const Screen& screen) { return screen.picture && !screen.picture->is_still(); });
}

bool Backdrop::is_over() const {
  return has_video() && std::ranges::all_of(screens_, [](const Screen& screen) {
           return !screen.picture || screen.picture->is_still() || screen.picture->has_begun_again();
         });
}

PictureColour Backdrop::colour_of_composite() const {
  return calibrated_ && are_rec709_ ? linear_rec709() : PictureColour();
}

int Backdrop::announced_frames() const {
  int max_frames = 0;
  for (const Screen& screen : screens_) {
    if (screen.picture && !screen.picture->is_still())
      max_frames = std::max(max_frames, screen.picture->announced_frames());
  }
  return max_frames;
}

}  // namespace glasswing
