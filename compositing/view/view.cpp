#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "compositing/picture/picture.h"
#include "compositing/view/commands.h"
#include "compositing/view/contact_sheet.h"
#include "compositing/view/matte_panels.h"
#include "compositing/view/sampled_matte.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/composite/stmap.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/footprint/matte_transport.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_notes.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {
namespace {

struct ViewArguments {
  std::string matte, output, only, channel, pixel, monitor;
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

absl::Status write_picture(const CommandLine& command_line, const std::string& output,
                           const CodeImage& picture) {
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_png8(picture));
  GW_RETURN_IF_ERROR(write_output(output, bytes));
  if (command_line.json) {
    std::cout << nlohmann::ordered_json(
                     {{"file", output}, {"width_px", picture.width_px}, {"height_px", picture.height_px}})
                     .dump(1)
              << "\n";
  } else {
    print_written(command_line, output, picture.width_px, picture.height_px);
  }
  return absl::OkStatus();
}

// The monitor named, or else the one that gives the pixel most light.
absl::StatusOr<int> texture_of(const std::string& name, const Matte& matte, int x, int y) {
  const auto& monitors = matte.metadata.monitors();
  if (!name.empty()) {
    const auto found = std::ranges::find(monitors, name, &v1::Monitor::name);
    if (found != monitors.end()) return static_cast<int>(found - monitors.begin());
    std::vector<std::string> names;
    for (const v1::Monitor& monitor : monitors) names.push_back(monitor.name());
    return absl::InvalidArgumentError(
        fmt::format("the matte has no monitor \"{}\"; it has {}", name, fmt::join(names, ", ")));
  }
  std::vector<float> light(monitors.size());
  for (int c = 0; c < kChannels; ++c) {
    for (const Mode& mode : matte.gaussians(x, y, c)) light[mode.texture] += mode.weight;
  }
  return static_cast<int>(std::ranges::max_element(light) - light.begin());
}

// A pixel's footprint on a monitor; the brightest place is white.
absl::StatusOr<CodeImage> footprint_of_pixel(std::string_view bytes, const ViewArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(bytes));
  int x = 0, y = 0;
  const bool read = Scanner(arguments.pixel).number(x).then(",").number(y).done();
  const int x0 = outline.x0_px, y0 = outline.y0_px;
  if (!read || x < x0 || y < y0 || x >= x0 + outline.width_px || y >= y0 + outline.height_px) {
    return absl::InvalidArgumentError(
        fmt::format("--pixel is \"{}\"; it must be COLUMN,ROW from {},{} to {},{}", arguments.pixel, x0, y0,
                    x0 + outline.width_px - 1, y0 + outline.height_px - 1));
  }
  std::optional<absl::StatusOr<RadianceImage>> light;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(
      bytes, 1,
      [&](Matte& rows) {
        if (y < rows.y0_px() || y >= rows.y0_px() + rows.height_px()) return absl::OkStatus();
        const int row = y - rows.y0_px(), column = x - rows.x0_px();
        const absl::StatusOr<int> texture = texture_of(arguments.monitor, rows, column, row);
        if (!texture.ok()) return texture.status();
        light.emplace(footprint_picture(rows, column, row, *texture));
        return absl::OkStatus();
      },
      Pyramids::kKept));
  const RadianceImage& seen = light->value();
  const float most = std::ranges::max(seen.samples);
  if (!(most > 0.0f)) {
    return absl::FailedPreconditionError(fmt::format("pixel {},{} sees no light of that monitor", x, y));
  }
  CodeImage picture(seen.width_px, seen.height_px);
  for (size_t i = 0; i < seen.samples.size(); ++i)
    picture.samples[i] = static_cast<std::uint8_t>(255.0f * srgb_of_linear(seen.samples[i] / most) + 0.5f);
  return picture;
}

absl::Status view(const CommandLine& command_line, const ViewArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  if (!arguments.pixel.empty()) {
    const absl::StatusOr<CodeImage> picture = footprint_of_pixel(file->bytes(), arguments);
    if (!picture.ok()) return in_file(arguments.matte, picture.status());
    return write_picture(command_line, arguments.output, *picture);
  }
  GW_RETURN_IF_ERROR(in_file(arguments.matte, tell_lost(file->bytes(), "sheets")));
  const absl::StatusOr<SampledMatte> sampled =
      sample_matte(file->bytes(), arguments.only.empty() ? kMaxSheetPixels : 0);
  if (!sampled.ok()) return in_file(arguments.matte, sampled.status());
  const Matte& matte = sampled->matte;
  const int channel =
      arguments.channel.empty()
          ? strongest_channel(matte)
          : static_cast<int>(std::ranges::find(kChannelNames, arguments.channel) - kChannelNames.begin());
  std::vector<MattePanel> panels = panels_of(matte, channel);
  const auto named = [&](std::string_view name) {
    return std::ranges::find(panels, name, &MattePanel::name);
  };
  CodeImage picture;
  if (arguments.only.empty()) {
    if (matte.metadata.footprint() != kPyramidFootprint) panels.erase(named("shape"));
    picture = contact_sheet(panels, heading_of(arguments, matte.metadata), lines_of(*sampled));
  } else {
    picture = named(arguments.only)->picture;
  }
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
      "A single panel (--only) has the matte's size in pixels; preview is F plus half of the weights. A "
      "pixel's footprint (--pixel) has the monitor's size, and its brightest place is white.\n\n"
      "Examples:\n"
      "  glasswing view vase.exr -o vase_sheet.png\n"
      "  glasswing view vase.exr --only preview -o vase.png\n"
      "  glasswing view vase.exr --pixel 64,52 -o footprint.png\n"
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
  CLI::Option* const pixel = command.add_option(
      "--pixel", arguments->pixel,
      "COLUMN,ROW: draw where on a monitor this pixel's light comes from, instead of the sheet");
  pixel->excludes("--only");
  command
      .add_option("--monitor", arguments->monitor,
                  "the monitor for --pixel; default: the one that gives it most light")
      ->needs(pixel);
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return view(command_line, *arguments); };
  });
}

}  // namespace glasswing
