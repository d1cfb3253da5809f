#include "core/edit/grade.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "client/edit/commands.h"
#include "client/edit/edited_matte.h"
#include "client/pictures/picture.h"
#include "core/base/status.h"
#include "core/edit/fill.h"
#include "core/edit/merge.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

struct GradeArguments : EditArguments {
  Grade grade;
  std::vector<float> gain;
  std::string only;
};

absl::Status grade(const Client& client, GradeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Matte matte, read_for_edit(arguments));
  Grade& wanted = arguments.grade;
  std::ranges::copy(arguments.gain, wanted.gain.begin());
  wanted.passing = arguments.only != "foreground";
  wanted.foreground = arguments.only != "passing";
  const std::string words = fmt::format("grade saturation {:g}, exposure {:g}, gain {:g}{}",
                                        wanted.saturation, wanted.exposure_stops, fmt::join(wanted.gain, ","),
                                        arguments.only.empty() ? "" : ", only " + arguments.only);
  return write_edited(client, arguments.output, graded(matte, wanted), words, Digits::kNew);
}

struct MergeArguments {
  std::vector<std::string> mattes;
  std::string output;
};

absl::Status merge(const Client& client, const MergeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  GW_ASSIGN_OR_RETURN(Matte all, read_matte(arguments.mattes.back()));
  for (size_t i = arguments.mattes.size() - 1; i-- > 0;) {
    GW_ASSIGN_OR_RETURN(const Matte front, read_matte(arguments.mattes[i]));
    absl::StatusOr<Matte> both = merged(front, all);
    if (!both.ok()) return in_file(arguments.mattes[i], both.status());
    all = *std::move(both);
  }
  return write_edited(client, arguments.output, std::move(all),
                      fmt::format("merge {}", fmt::join(arguments.mattes, " ")));
}

struct FillArguments : EditArguments {
  bool flagged = false;
};

absl::Status fill_matte(const Client& client, const FillArguments& arguments) {
  GW_ASSIGN_OR_RETURN(Matte matte, read_for_edit(arguments));
  constexpr std::uint8_t kAllFlags = kFlagNotConverged | kFlagSaturated | kFlagPoorFit | kFlagNoData;
  const std::int64_t count = fill(matte, arguments.flagged ? kAllFlags : std::uint8_t{kFlagNoData});
  return write_edited(client, arguments.output, std::move(matte), arguments.flagged ? "fill flagged" : "fill",
                      Digits::kAsTheyAre, fmt::format("; {} pixels filled from their neighbours", count),
                      {{"filled_pixels", count}});
}

}  // namespace

void add_matte_grade_command(CLI::App& matte, Client& client) {
  CLI::App& command = *matte.add_subcommand("grade", "Change the colour and brightness of an object.");
  command.footer(
      "Saturation comes first, then exposure and gain. Light passes the object by the weights of its modes; "
      "the\n"
      "foreground is the object's own light.\n\n"
      "Examples:\n"
      "  glasswing matte grade vase.exr --exposure 0.5 -o brighter.exr\n"
      "  glasswing matte grade vase.exr --saturation 0 --only passing -o clear.exr\n"
      "  glasswing matte grade vase.exr --gain 1,0.9,0.8 -o warm.exr");
  auto arguments = std::make_shared<GradeArguments>();
  add_edit_options(command, *arguments);
  command
      .add_option("--saturation", arguments->grade.saturation,
                  "distance from gray: 0 none, 1 as it is, above 1 more")
      ->check(CLI::Range(0.0f, 100.0f))
      ->capture_default_str();
  command.add_option("--exposure", arguments->grade.exposure_stops, "stops: 1 is twice as bright")
      ->check(CLI::Range(-20.0f, 20.0f))
      ->capture_default_str();
  command.add_option("--gain", arguments->gain, "R,G,B: a factor for each of the camera's channels")
      ->delimiter(',')
      ->expected(kChannels)
      ->check(CLI::Range(0.0f, 1e6f));
  command.add_option("--only", arguments->only, "what to change: passing or foreground; default: both")
      ->check(CLI::IsMember({"passing", "foreground"}));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return grade(client, *arguments); }; });
}

void add_matte_merge_command(CLI::App& matte, Client& client) {
  CLI::App& command = *matte.add_subcommand("merge", "Put objects that were captured apart into one matte.");
  command.footer(
      "The first matte is in front; each hides the next as far as it covers a pixel. All must be of one "
      "camera "
      "before\nthe same monitors. One object is not seen through another: each was captured alone.\n\n"
      "Examples:\n"
      "  glasswing matte merge vase.exr glass.exr -o both.exr");
  auto arguments = std::make_shared<MergeArguments>();
  command.add_option("mattes", arguments->mattes, "two or more mattes, the first in front")
      ->required()
      ->expected(2, 100);
  command.add_option("-o,--output", arguments->output, "the matte to write (.exr)")->required();
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return merge(client, *arguments); }; });
}

void add_matte_fill_command(CLI::App& matte, Client& client) {
  CLI::App& command = *matte.add_subcommand("fill", "Fill pixels that are not solved from their neighbours.");
  command.footer(
      "Filled pixels are a guess, and flagged as filled: their errors are not known.\n\n"
      "Examples:\n"
      "  glasswing matte fill vase.exr -o filled.exr\n"
      "  glasswing matte fill vase.exr --flagged -o filled.exr");
  auto arguments = std::make_shared<FillArguments>();
  add_edit_options(command, *arguments);
  command.add_flag("--flagged", arguments->flagged,
                   "also pixels with another flag: not converged, saturated, poor fit");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return fill_matte(client, *arguments); }; });
}

}  // namespace glasswing
