#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "compositing/edit/grade.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

struct GradeArguments : EditArguments {
  Grade grade;
  std::vector<float> gain;
  std::string only;
};

absl::Status grade(const CommandLine& command_line, const GradeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Matte matte, read_for_edit(arguments));
  Grade wanted = arguments.grade;
  std::ranges::copy(arguments.gain, wanted.gain.begin());
  wanted.passing = arguments.only != "foreground";
  wanted.foreground = arguments.only != "passing";
  const std::string words = fmt::format("grade saturation {:g}, exposure {:g}, gain {:g}{}",
                                        wanted.saturation, wanted.exposure_stops, fmt::join(wanted.gain, ","),
                                        arguments.only.empty() ? "" : ", only " + arguments.only);
  return write_edited(command_line, arguments.output, graded(matte, wanted), words, Digits::kNew);
}

}  // namespace

void add_matte_grade_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<GradeArguments>();
  CLI::App& command = add_edit_command(
      matte, command_line, "grade", "Change the colour and brightness of an object.",
      "Saturation comes first, then exposure and gain. Light that passes the object is in the weights of its "
      "modes; the foreground is the object's own light.\n\n"
      "Examples:\n"
      "  glasswing matte grade vase.exr --exposure 0.5 -o brighter.exr\n"
      "  glasswing matte grade vase.exr --saturation 0 --only passing -o clear.exr\n"
      "  glasswing matte grade vase.exr --gain 1,0.9,0.8 -o warm.exr",
      arguments, grade);
  command
      .add_option("--saturation", arguments->grade.saturation,
                  "distance from gray: 0 gray, 1 unchanged, above 1 more saturated")
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
}

}  // namespace glasswing
