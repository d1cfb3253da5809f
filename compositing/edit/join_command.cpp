#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/matte/row_part.h"

namespace glasswing {
namespace {

struct JoinArguments {
  std::vector<std::string> parts;
  std::string output;
};

absl::Status join(const CommandLine& command_line, const JoinArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  UnfinishedFile unfinished(arguments.output);
  JoinedParts joined;
  {
    GW_ASSIGN_OR_RETURN(PositionedFile file, PositionedFile::create(unfinished.path()));
    GW_ASSIGN_OR_RETURN(joined, join_parts({arguments.parts.begin(), arguments.parts.end()}, file));
  }
  GW_RETURN_IF_ERROR(unfinished.finish());
  if (const std::string mixed = mixed_vectors(joined); !mixed.empty())
    std::cerr << "warning: " << mixed << "\n";
  print_edited(command_line, arguments.output, joined.outline.width_px, joined.outline.height_px,
               fmt::format(" of {} parts", arguments.parts.size()),
               {{"parts", arguments.parts.size()}, {"session", joined.outline.metadata.session()}});
  return absl::OkStatus();
}

}  // namespace

void add_matte_join_command(CLI::App& matte, CommandLine& command_line) {
  CLI::App& command = *matte.add_subcommand("join", "Join separately solved parts of rows into a matte.");
  command.footer(
      "glasswing-solver solve ARCHIVE --rows K/N -o part-K.exr writes part K of N, on any machine that can "
      "read the archive. The joined file equals that of a single process, byte for byte. The parts may be in "
      "any order; missing or duplicate rows are rejected by name, as are parts of another archive, method, "
      "option or version.\n\n"
      "Example:\n"
      "  glasswing matte join part-*.exr -o vase.exr");
  auto arguments = std::make_shared<JoinArguments>();
  command.add_option("parts", arguments->parts, "all parts of the matte (.exr)")
      ->required()
      ->expected(1, 10000);
  command.add_option("-o,--output", arguments->output, "the matte to write (.exr), or - for standard output")
      ->required();
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return join(command_line, *arguments); };
  });
}

}  // namespace glasswing
