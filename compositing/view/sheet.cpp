#include <fmt/format.h>

#include <filesystem>
#include <opencv2/core.hpp>

#include "compositing/picture/picture.h"
#include "compositing/view/commands.h"
#include "compositing/view/contact_sheet.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

constexpr int kMaxPictures = 64;

struct SheetArguments {
  std::vector<std::string> pictures;  // [TITLE=]FILE
  std::string output, heading;
  int columns = 0;
};

absl::StatusOr<MattePanel> panel_of(const std::string& argument) {
  const size_t equals = argument.find('=');
  const std::string file = equals == std::string::npos ? argument : argument.substr(equals + 1);
  GW_ASSIGN_OR_RETURN(const RadianceImage picture, read_picture(file, Encoding::kDisplay));
  MattePanel panel;
  panel.title = equals == std::string::npos ? std::filesystem::path(file).filename().string()
                                            : argument.substr(0, equals);
  panel.picture = CodeImage(picture.width_px, picture.height_px);
  std::ranges::transform(picture.samples, panel.picture.samples.begin(), [](float light) {
    return cv::saturate_cast<std::uint8_t>(255.0f * srgb_of_linear(light));
  });
  return panel;
}

absl::StatusOr<std::vector<MattePanel>> read_panels(const SheetArguments& arguments) {
  const Waiting waiting("reading");
  std::vector<MattePanel> panels;
  for (const std::string& argument : arguments.pictures) {
    GW_ASSIGN_OR_RETURN(MattePanel panel, panel_of(argument));
    if (!panels.empty() && (panel.picture.width_px != panels[0].picture.width_px ||
                            panel.picture.height_px != panels[0].picture.height_px)) {
      return absl::InvalidArgumentError(
          fmt::format("{} is {}x{} and {} is {}x{}; the pictures of a sheet must have one size",
                      arguments.pictures[0], panels[0].picture.width_px, panels[0].picture.height_px,
                      argument, panel.picture.width_px, panel.picture.height_px));
    }
    panels.push_back(std::move(panel));
  }
  return panels;
}

absl::Status sheet(const CommandLine& command_line, const SheetArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::vector<MattePanel> panels, read_panels(arguments));
  const CodeImage picture = contact_sheet(panels, arguments.heading, {}, arguments.columns);
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_png8(picture));
  GW_RETURN_IF_ERROR(write_output(arguments.output, bytes));
  print_written(command_line, arguments.output, picture.width_px, picture.height_px);
  return absl::OkStatus();
}

}  // namespace

void add_sheet_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand("sheet", "Arrange pictures of one size on a labelled sheet.");
  command.footer(
      "Examples:\n"
      "  glasswing sheet vase.png vase_photographed.png -o sheet.png\n"
      "  glasswing sheet composite=vase.png photographed=real.png --columns 2 --heading Vase -o sheet.png");
  auto arguments = std::make_shared<SheetArguments>();
  command
      .add_option("pictures", arguments->pictures,
                  fmt::format("[TITLE=]FILE: PNG, JPEG, TIFF or EXR; at most {}", kMaxPictures))
      ->required()
      ->expected(1, kMaxPictures);
  command.add_option("-o,--output", arguments->output, "the PNG file to write, or - for standard output")
      ->required()
      ->check(output_file({".png", kStandardOutput}));
  command.add_option("--heading", arguments->heading, "a line above the pictures; ASCII");
  command
      .add_option("--columns", arguments->columns, "pictures in a row (1 to 64; default: as many as suit)")
      ->check(CLI::Range(1, kMaxPictures));
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return sheet(command_line, *arguments); };
  });
}

}  // namespace glasswing
