#include "compositing/picture/commands.h"
#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/progress.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

struct ConvertArguments {
  std::string input;
  std::string output;
  std::string crop;
  bool linear = false;
  ColourArguments colours;
};

absl::StatusOr<RadianceImage> converted(const ConvertArguments& arguments) {
  const Waiting waiting("converting");
  GW_ASSIGN_OR_RETURN(const PictureColours colours, PictureColours::open(arguments.colours));
  GW_ASSIGN_OR_RETURN(
      const CapturedPicture whole,
      read_picture(arguments.input, colours, arguments.linear ? Encoding::kLinear : Encoding::kDisplay));
  GW_ASSIGN_OR_RETURN(const RadianceImage picture, cropped(whole.light, arguments.crop));
  GW_RETURN_IF_ERROR(colours.write(arguments.output, picture, Encoding::kDisplay, 0, whole.colour));
  return picture;
}

absl::Status convert(const CommandLine& command_line, const ConvertArguments& arguments) {
  GW_RETURN_IF_ERROR(check_output(arguments.output));
  GW_ASSIGN_OR_RETURN(const RadianceImage picture, converted(arguments));
  print_written(command_line, arguments.output, picture.width_px, picture.height_px);
  return absl::OkStatus();
}

}  // namespace

void add_convert_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand("convert", "Convert a frame or a picture into one for viewing.");
  command.footer(
      "The output is sRGB (PNG, TIFF) or linear (EXR), or in the space of --ocio-out. An EXR records in its "
      "header what is\n"
      "known about its colours.\n\n"
      "Examples:\n"
      "  glasswing convert --linear archive/frames/000310.tif look.png\n"
      "  glasswing convert harbour.png harbour.exr --ocio-config studio.ocio --ocio-out ACEScg");
  auto arguments = std::make_shared<ConvertArguments>();
  command.add_option("input", arguments->input, "the picture to read")->required();
  command.add_option("output", arguments->output, "the picture to write: .png, .tif or .exr")->required();
  command.add_option("--crop", arguments->crop, kCropHelp);
  command.add_flag("--linear", arguments->linear,
                   "the input's PNG or TIFF values are linear radiance, as in frames");
  add_colour_options(command, arguments->colours);
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return convert(command_line, *arguments); };
  });
}

}  // namespace glasswing
