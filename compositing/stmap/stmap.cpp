#include "core/composite/stmap.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/picture/picture.h"
#include "compositing/stmap/commands.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/mapped_file.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {
namespace {

struct StmapArguments {
  std::string matte, output, monitor, channel;
  int path = 0;
};

absl::Status write_stmap(const CommandLine& command_line, const StmapArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> matte, MappedFile::open(arguments.matte));
  GW_RETURN_IF_ERROR(in_file(arguments.matte, tell_lost(matte->bytes(), "STMaps")));
  StmapChoice choice{.monitor = arguments.monitor, .path = arguments.path};
  if (!arguments.channel.empty())
    choice.channel =
        static_cast<int>(std::ranges::find(kChannelNames, arguments.channel) - kChannelNames.begin());
  UnfinishedFile file(arguments.output);
  const absl::StatusOr<WrittenStmap> stmap = write_stmap(matte->bytes(), choice, file.path());
  if (!stmap.ok()) return in_file(arguments.matte, stmap.status());
  GW_RETURN_IF_ERROR(file.finish());
  const char* colour = kChannelNames[stmap->channel];
  if (command_line.json) {
    const nlohmann::ordered_json written = {{"file", arguments.output},
                                            {"monitor", stmap->monitor},
                                            {"channel", colour},
                                            {"width_px", stmap->width_px},
                                            {"height_px", stmap->height_px}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: where channel {} looks on monitor {}, {}x{}\n", arguments.output, colour,
                             stmap->monitor, stmap->width_px, stmap->height_px);
  }
  return absl::OkStatus();
}

}  // namespace

void add_stmap_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand(
      "stmap", "Write one path of a matte as an STMap, with which compositing programs warp a picture.");
  command.footer(
      "R and G are the position on the monitor, 0 to 1 from its bottom left corner; B and A are 1 where "
      "there\n"
      "is one. Layer weight is the fraction of the light that reaches the camera, blur the width of the path "
      "in monitor\n"
      "pixels. glasswing composite uses all paths and widths of a matte.\nOpenImageIO applies it with: "
      "oiiotool PICTURE vase_st.exr --st_warp:flip_t=1 -o WARPED\n\n"
      "Examples:\n"
      "  glasswing stmap vase.exr -o vase_st.exr\n"
      "  glasswing stmap vase.exr --path 2 -o vase_reflection_st.exr\n"
      "  glasswing stmap vase.exr --monitor left --channel b -o vase_left_b.exr");
  auto arguments = std::make_shared<StmapArguments>();
  command.add_option("matte", arguments->matte, "a matte from glasswing fetch")->required();
  command.add_option("-o,--output", arguments->output, "the OpenEXR file to write, or - for standard output")
      ->required()
      ->check(output_file({".exr", kStandardOutput}));
  command.add_option("--monitor", arguments->monitor, "the monitor's name; default: the first");
  command
      .add_option("--channel", arguments->channel,
                  "channel of the path; default: g, or another channel if it has much more light")
      ->check(CLI::IsMember(kChannelNames));
  command
      .add_option("--path", arguments->path,
                  "follow one path of light across pixels: 1 has the most light, then 2 and so on; default: "
                  "each pixel's strongest path")
      ->check(CLI::Range(1, kMaxModes));
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return write_stmap(command_line, *arguments); };
  });
}

}  // namespace glasswing
