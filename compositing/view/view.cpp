#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>

#include "compositing/picture/picture.h"
#include "compositing/view/commands.h"
#include "compositing/view/contact_sheet.h"
#include "compositing/view/matte_panels.h"
#include "compositing/view/sampled_matte.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/composite/stmap.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_notes.h"

namespace glasswing {
namespace {

struct ViewArguments {
  std::string matte, output, only, channel;
};

// A panel of the sheet is some hundred pixels wide: more would not be visible.
constexpr std::int64_t kMaxSheetPixels = 2'000'000;

// The matte's metadata in words.
std::vector<std::string> lines_of(const SampledMatte& sampled) {
  const v1::MatteMetadata& metadata = sampled.outline.metadata;
  std::vector<std::string> monitors;
  for (const v1::Monitor& monitor : metadata.monitors())
    monitors.push_back(fmt::format("{} {}x{}", monitor.name(), monitor.width_px(), monitor.height_px()));
  std::string options;
  for (const auto& [name, value] :
       std::map<std::string, std::string>(metadata.options().begin(), metadata.options().end()))
    options += fmt::format(", {} {}", name, value);
  std::vector<std::string> lines = {
      fmt::format("{}x{} px, {} of them object{}. Method {}{}. Monitor{}: {}. {}", sampled.outline.width_px,
                  sampled.outline.height_px, sampled.pixels.object, unsolved_text(sampled.pixels.unsolved),
                  metadata.method(), options, monitors.size() == 1 ? "" : "s", fmt::join(monitors, ", "),
                  metadata.created())};
  if (sampled.step > 1) lines.push_back(fmt::format("Panels show one pixel of {0}x{0}.", sampled.step));
  for (const std::string& warning : metadata.warnings()) lines.push_back("Warning: " + warning);
  return lines;
}

std::string heading_of(const ViewArguments& arguments, const v1::MatteMetadata& metadata) {
  std::string heading = metadata.session().empty()
                            ? std::filesystem::path(arguments.matte).filename().string()
                            : metadata.session();
  if (metadata.has_frame()) heading += fmt::format(", frame {}", metadata.frame());
  return heading;
}

absl::Status view(const CommandLine& command_line, const ViewArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  const absl::StatusOr<SampledMatte> sampled =
      sample_matte(file->bytes(), arguments.only.empty() ? kMaxSheetPixels : 0);
  if (!sampled.ok()) return in_file(arguments.matte, sampled.status());
  const Matte& matte = sampled->matte;
  const int channel =
      arguments.channel.empty()
          ? strongest_channel(matte)
          : static_cast<int>(std::ranges::find(kChannelNames, arguments.channel) - kChannelNames.begin());
  const std::vector<MattePanel> panels = panels_of(matte, channel);
  const CodeImage picture =
      arguments.only.empty()
          ? contact_sheet(panels, heading_of(arguments, matte.metadata), lines_of(*sampled))
          : std::ranges::find(panels, arguments.only, &MattePanel::name)->picture;
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_png8(picture));
  GW_RETURN_IF_ERROR(write_output(arguments.output, bytes));
  if (command_line.json) {
    nlohmann::ordered_json written = {
        {"file", arguments.output}, {"width_px", picture.width_px}, {"height_px", picture.height_px}};
    add_notes(warnings_of(matte.metadata), sampled->pixels, written);
    std::cout << written.dump(1) << "\n";
  } else {
    print_written(command_line, arguments.output, picture.width_px, picture.height_px);
    print_flagged(sampled->pixels);
  }
  print_warnings(warnings_of(matte.metadata));
  return absl::OkStatus();
}

}  // namespace

void add_view_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand("view", "Draw a matte's contents as a sheet of labelled panels.");
  command.footer(
      "A single panel (--only) has the matte's size in pixels; preview is F plus half of the weights.\n\n"
      "Examples:\n"
      "  glasswing view vase.exr -o vase_sheet.png\n"
      "  glasswing view vase.exr --only preview -o vase.png\n"
      "  glasswing view pouring/0007.exr --channel r -o pouring-7.png");
  auto arguments = std::make_shared<ViewArguments>();
  command.add_option("matte", arguments->matte, "a matte from glasswing fetch")->required();
  command.add_option("-o,--output", arguments->output, "the PNG file to write, or - for standard output")
      ->required()
      ->check(output_file({".png", kStandardOutput}));
  command.add_option("--only", arguments->only, "write one panel, without title and legend")
      ->check(CLI::IsMember(kPanelNames));
  command
      .add_option(
          "--channel", arguments->channel,
          "channel of centre, sigma and uncertainty; default: g, or another channel if it has much more "
          "light")
      ->check(CLI::IsMember(kChannelNames));
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return view(command_line, *arguments); };
  });
}

}  // namespace glasswing
