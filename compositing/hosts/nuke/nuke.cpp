#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/composite/composite_rays.h"
#include "compositing/hosts/nuke/commands.h"
#include "compositing/hosts/nuke/nuke_script.h"
#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {
namespace {

struct NukeArguments {
  std::string matte, output;
};

absl::Status write_nuke_script(const CommandLine& command_line, const NukeArguments& arguments) {
  if (holds_rays(arguments.matte)) {
    return absl::InvalidArgumentError(fmt::format(
        "{} contains rays, which glasswing composite shows; Nuke scripts need mattes", arguments.matte));
  }
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> matte, MappedFile::open(arguments.matte));
  GW_RETURN_IF_ERROR(in_file(arguments.matte, tell_lost(matte->bytes(), "Nuke scripts")));
  const absl::StatusOr<NukeScript> script =
      nuke_script(matte->bytes(), std::filesystem::absolute(arguments.matte).lexically_normal().string());
  if (!script.ok()) return in_file(arguments.matte, script.status());
  GW_RETURN_IF_ERROR(write_output(arguments.output, script->text));
  if (command_line.json) {
    const nlohmann::ordered_json written = {{"file", arguments.output}, {"nodes", script->node_count}};
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {} nodes, which read {}\n", arguments.output, script->node_count,
                             arguments.matte);
  }
  return absl::OkStatus();
}

}  // namespace

void add_nuke_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand(
      "nuke", "Write a script for Nuke that shows a matte's object in front of any picture.");
  command.footer(
      "The script reads the matte and contains one group of Nuke's own nodes, with an input for each "
      "monitor: "
      "plug\n"
      "in the picture behind the object, in linear light. All modes, places and widths are used "
      "(docs/hosts.md).\n"
      "It was checked against descriptions of the nodes, but never run in Nuke.\n\n"
      "Examples:\n"
      "  glasswing nuke vase.exr -o vase.nk\n"
      "  glasswing nuke /shows/spring/vase.exr -o vase.nk   # the script names this file");
  auto arguments = std::make_shared<NukeArguments>();
  command.add_option("matte", arguments->matte, "a matte from glasswing fetch")->required();
  command.add_option("-o,--output", arguments->output, "the script to write, .nk, or - for standard output")
      ->required()
      ->check(output_file({".nk", kStandardOutput}));
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return write_nuke_script(command_line, *arguments); };
  });
}

}  // namespace glasswing
