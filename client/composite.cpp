#include "client/composite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/picture.h"
#include "client/progress.h"
#include "core/base/status.h"
#include "core/matte/compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

struct Arguments {
  std::string matte;
  std::vector<std::string> backgrounds;
  std::string output;
  std::string crop;
  bool linear = false;
};

absl::Status composite_file(const Client& client, const Arguments& arguments) {
  GW_RETURN_IF_ERROR(check_output(arguments.output));
  GW_ASSIGN_OR_RETURN(const Matte matte, read_matte(arguments.matte));
  const Encoding encoding = arguments.linear ? Encoding::kLinear : Encoding::kDisplay;
  GW_ASSIGN_OR_RETURN(const std::vector<RadianceImage> backgrounds,
                      load_backgrounds(arguments.backgrounds, matte.metadata, encoding));
  absl::StatusOr<RadianceImage> picture;
  {
    Progress progress("compositing");
    picture = composite(matte, backgrounds, 0, [&progress](double fraction) { progress.update(fraction); });
  }
  GW_RETURN_IF_ERROR(picture.status());
  GW_ASSIGN_OR_RETURN(picture, cropped(*picture, arguments.crop));
  GW_RETURN_IF_ERROR(write_radiance(arguments.output, *picture, encoding));
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

absl::StatusOr<std::vector<RadianceImage>> load_backgrounds(const std::vector<std::string>& arguments,
                                                            const v1::MatteMetadata& metadata,
                                                            Encoding encoding) {
  if (metadata.monitors().empty()) return absl::DataLossError("the matte's header names no monitors");
  std::vector<RadianceImage> backgrounds(static_cast<size_t>(metadata.monitors_size()));
  for (const std::string& argument : arguments) {
    GW_ASSIGN_OR_RETURN(const BackgroundArgument background, parse_background(argument, metadata));
    const v1::Monitor& monitor = metadata.monitors(background.texture);
    RadianceImage& slot = backgrounds[static_cast<size_t>(background.texture)];
    if (!slot.empty()) {
      return absl::InvalidArgumentError(
          fmt::format("--background names the texture \"{}\" twice; each takes one picture", monitor.name()));
    }
    GW_ASSIGN_OR_RETURN(const RadianceImage picture, read_radiance(background.file, encoding));
    slot = resized(picture, monitor.width_px(), monitor.height_px());
  }
  return backgrounds;
}

void add_composite_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("composite", "Put the object of a matte in front of other pictures.");
  command.footer(
      "A picture is scaled to its monitor; monitors without one are black. TEXTURE is a monitor's name, the "
      "first\n"
      "monitor if left out. EXR is linear radiance, 1.0 = the archive's full scale; PNG and TIFF are "
      "sRGB.\n\n"
      "Examples:\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png\n"
      "  glasswing composite vase.exr --background back=harbour.png --background left=quilt.png -o "
      "vase_out.exr");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("matte", arguments->matte, "a matte that glasswing fetch wrote")->required();
  command.add_option("--background", arguments->backgrounds, "[TEXTURE=]IMAGE; may be repeated")->required();
  command.add_option("-o,--output", arguments->output, "the picture to write: .exr, .png or .tif")
      ->required();
  command.add_option("--crop", arguments->crop, kCropHelp);
  command.add_flag("--linear", arguments->linear,
                   "PNG and TIFF values are linear radiance, value / full scale");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return composite_file(client, *arguments); };
  });
}

}  // namespace glasswing
