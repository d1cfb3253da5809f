#include "client/composite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/composite_video.h"
#include "client/picture.h"
#include "client/progress.h"
#include "core/base/status.h"
#include "core/matte/compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

absl::Status composite_still(const Client& client, const CompositeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_output(arguments.output));
  GW_ASSIGN_OR_RETURN(Matte matte, read_matte(arguments.matte));
  brighten_foreground(matte, arguments.foreground_gain);
  GW_ASSIGN_OR_RETURN(Backgrounds backgrounds, Backgrounds::open(arguments.backgrounds, arguments.matches,
                                                                 matte.metadata, arguments.encoding()));
  GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage>* const behind, backgrounds.next());
  absl::StatusOr<RadianceImage> picture;
  {
    Progress progress("compositing");
    picture = composite(matte, *behind, 0, [&progress](double fraction) { progress.update(fraction); });
  }
  GW_RETURN_IF_ERROR(picture.status());
  GW_ASSIGN_OR_RETURN(picture, cropped(*picture, arguments.crop));
  GW_RETURN_IF_ERROR(write_radiance(arguments.output, *picture, arguments.encoding()));
  if (client.json) {
    const nlohmann::ordered_json written = {
        {"file", arguments.output}, {"width_px", picture->width_px}, {"height_px", picture->height_px}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {}x{}\n", arguments.output, picture->width_px, picture->height_px);
  }
  return absl::OkStatus();
}

}  // namespace

void brighten_foreground(Matte& matte, float gain) {
  if (gain == 1.0f) return;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (float& light : matte.foreground(x, y)) light *= gain;
    }
  }
}

absl::StatusOr<BackgroundArgument> parse_background(const std::string& argument,
                                                    const v1::MatteMetadata& metadata) {
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
  return absl::InvalidArgumentError(fmt::format("--background names the texture \"{}\"; this matte has: {}",
                                                texture, fmt::join(names, ", ")));
}

absl::StatusOr<Backgrounds> Backgrounds::open(const std::vector<std::string>& arguments,
                                              const std::vector<std::string>& matches,
                                              const v1::MatteMetadata& metadata, Encoding encoding) {
  if (metadata.monitors().empty()) return absl::DataLossError("the matte's header names no monitors");
  Backgrounds backgrounds;
  for (const v1::Monitor& monitor : metadata.monitors()) {
    backgrounds.screens_.emplace_back();
    backgrounds.screens_.back().width_px = monitor.width_px();
    backgrounds.screens_.back().height_px = monitor.height_px();
  }
  for (const std::string& argument : arguments) {
    GW_ASSIGN_OR_RETURN(const BackgroundArgument background, parse_background(argument, metadata));
    Screen& screen = backgrounds.screens_[static_cast<size_t>(background.texture)];
    if (screen.picture) {
      return absl::InvalidArgumentError(
          fmt::format("--background names the texture \"{}\" twice; each takes one picture",
                      metadata.monitors(background.texture).name()));
    }
    GW_ASSIGN_OR_RETURN(screen.picture, MovingPicture::open(background.file, encoding));
  }
  for (const std::string& argument : matches) {
    GW_ASSIGN_OR_RETURN(const BackgroundArgument match, parse_background(argument, metadata));
    Screen& screen = backgrounds.screens_[static_cast<size_t>(match.texture)];
    if (!screen.picture) {
      return absl::InvalidArgumentError(
          fmt::format("--match names the texture \"{}\", which has no --background",
                      metadata.monitors(match.texture).name()));
    }
    GW_ASSIGN_OR_RETURN(screen.photograph, read_radiance(match.file, encoding));
  }
  backgrounds.now_.resize(backgrounds.screens_.size());
  return backgrounds;
}

absl::StatusOr<const std::vector<RadianceImage>*> Backgrounds::next() {
  for (size_t t = 0; t < screens_.size(); ++t) {
    Screen& screen = screens_[t];
    if (!screen.picture || (screen.picture->is_still() && !now_[t].empty())) continue;
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, screen.picture->next());
    now_[t] = resized(picture, screen.width_px, screen.height_px);
    if (screen.photograph.empty()) continue;
    // A video's first picture tells for all: matched one by one they would flicker.
    if (!screen.match) {
      GW_ASSIGN_OR_RETURN(screen.match, HistogramMatch::learn(now_[t], screen.photograph));
    }
    screen.match->apply(now_[t]);
  }
  return &now_;
}

void add_composite_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "composite", "Put the object of a matte, or of a video, in front of other pictures.");
  command.footer(
      "A picture is scaled to its monitor; monitors without one are black. TEXTURE is a monitor's name, the "
      "first\n"
      "monitor if left out. EXR is linear radiance, 1.0 = the archive's full scale; PNG and TIFF are "
      "sRGB.\n\n"
      "A directory of mattes (glasswing fetch VIDEO -o DIR/) gives a picture a frame, 0000.exr or 0000.png, "
      "or a video "
      "file.\n"
      "Behind it may be a still, a directory of pictures, or a video file; these begin again after their "
      "end.\n\n"
      "Examples:\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png\n"
      "  glasswing composite vase.exr --background back=harbour.png --background left=quilt.png -o "
      "vase_out.exr\n"
      "  glasswing composite pour/ --background harbour.png -o frames/ --format png\n"
      "  glasswing composite pour/ --background waves.mp4 -o pour.mp4 --fps 30\n"
      "  glasswing composite vase.exr --background harbour.png --match harbour_on_monitor.png -o vase.png");
  auto arguments = std::make_shared<CompositeArguments>();
  command
      .add_option("matte", arguments->matte, "what glasswing fetch wrote: a matte, or a directory of them")
      ->required();
  command.add_option("--background", arguments->backgrounds, "[TEXTURE=]IMAGE; may be repeated")
      ->required()
      ->allow_extra_args(false);
  command
      .add_option(
          "-o,--output", arguments->output,
          "a picture: .exr, .png or .tif; of several mattes: a directory, or a video: .mp4, .mov, .mkv, "
          ".avi or .webm")
      ->required();
  command.add_option("--format", arguments->format, "of the pictures in a directory")
      ->check(CLI::IsMember({"exr", "png", "tif"}))
      ->capture_default_str();
  command.add_option("--fps", arguments->frame_rate_hz, "of a video that is written")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command
      .add_option("--match", arguments->matches,
                  "[TEXTURE=]PHOTOGRAPH: gives the background its colours, such as those that a photograph "
                  "of it on a "
                  "monitor has")
      ->allow_extra_args(false);
  command
      .add_option("--foreground-gain", arguments->foreground_gain,
                  "times the object's own light F: highlights of a video often look better above 1")
      ->check(CLI::Range(0.0f, 100.0f))
      ->capture_default_str();
  command.add_option("--crop", arguments->crop, kCropHelp);
  command.add_flag("--linear", arguments->linear,
                   "PNG and TIFF values are linear radiance, value / full scale");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] {
      return std::filesystem::is_directory(arguments->matte) ? composite_video(client, *arguments)
                                                             : composite_still(client, *arguments);
    };
  });
}

}  // namespace glasswing
