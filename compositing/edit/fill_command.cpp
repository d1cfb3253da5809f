#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "core/base/status.h"
#include "core/footprint/fill.h"

namespace glasswing {
namespace {

struct FillArguments : EditArguments {
  bool flagged = false;
};

absl::Status fill_matte(const CommandLine& command_line, const FillArguments& arguments) {
  GW_ASSIGN_OR_RETURN(Matte matte, read_for_edit(arguments));
  constexpr std::uint8_t kAllFlags =
      kFlagNotConverged | kFlagSaturated | kFlagPoorFit | kFlagNoData | kFlagDisturbed;
  const std::int64_t count = fill(matte, arguments.flagged ? kAllFlags : std::uint8_t{kFlagNoData});
  return write_edited(command_line, arguments.output, std::move(matte),
                      arguments.flagged ? "fill flagged" : "fill", Digits::kAsTheyAre,
                      fmt::format("; {} pixels filled from their neighbours", count),
                      {{"filled_pixels", count}});
}

}  // namespace

void add_matte_fill_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<FillArguments>();
  CLI::App& command =
      add_edit_command(matte, command_line, "fill", "Fill unsolved pixels from their neighbours.",
                       "Filled pixels are a guess, and flagged as filled: their errors are not known.\n\n"
                       "Examples:\n"
                       "  glasswing matte fill vase.exr -o filled.exr\n"
                       "  glasswing matte fill vase.exr --flagged -o filled.exr",
                       arguments, fill_matte);
  command.add_flag("--flagged", arguments->flagged,
                   "also pixels with another flag: not converged, saturated, disturbed, poor fit");
}

}  // namespace glasswing
