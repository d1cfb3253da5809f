#include <fmt/format.h>

#include <iostream>
#include <map>

#include "client/plans/commands.h"
#include "client/plans/rig_limits.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/pattern/plan_fit.h"

namespace glasswing {
namespace {

struct PlanMakeArguments {
  RigLimitsArguments rig;
  std::string quality = "good", object = "clear", output = kStandardOutput;
  int images = 0;  // 0: as many as the quality takes
};

absl::Status make(const Client& client, const PlanMakeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const RigLimits rig, read_plan_limits(client, arguments.rig));
  PlanWish wish{.quality = plan_qualities().at(arguments.quality),
                .images = {},
                .object = object_kinds().at(arguments.object)};
  if (arguments.images > 0) wish.images = arguments.images;
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, make_plan(wish, rig));
  const std::string text = plan_text(plan, rig);
  GW_RETURN_IF_ERROR(write_output(arguments.output, text));
  if (arguments.output != kStandardOutput) {
    std::cerr << fmt::format("{}: {} images with the object; for its cost: glasswing plan estimate {}\n",
                             arguments.output, images_of(plan, rig), arguments.output);
  }
  return absl::OkStatus();
}

}  // namespace

void add_plan_make_command(CLI::App& plan, Client& client) {
  CLI::App& command =
      *plan.add_subcommand("make", "Make a plan for method gaussian that fits the monitors and the camera.");
  command.footer(
      "Without --monitor the server's monitors are used; --for-rig also chooses exposures and hold_refreshes "
      "for its camera.\n\n"
      "Examples:\n"
      "  glasswing plan make --for-rig -o vase.txtpb\n"
      "  glasswing plan make --for-rig --quality best --images 800 -o vase.txtpb\n"
      "  glasswing plan make --for-rig --object metal -o spoon.txtpb\n"
      "  glasswing plan make --monitor back:1920x1080 --quality draft");
  auto arguments = std::make_shared<PlanMakeArguments>();
  add_rig_limits_options(command, arguments->rig);
  command
      .add_option(
          "--quality", arguments->quality,
          "draft: about a hundred images; good; best: finer stripes, and a second exposure for highlights")
      ->check(CLI::IsMember(plan_qualities()))
      ->capture_default_str();
  command
      .add_option(
          "--object", arguments->object,
          "clear: glass, water, crystal; frosted, also brushed: wider stripes; metal: a second exposure, for "
          "highlights; dark: a second exposure, longer")
      ->check(CLI::IsMember(object_kinds()))
      ->capture_default_str();
  command.add_option("--images", arguments->images, "maximum number with the object, at each exposure")
      ->check(CLI::Range(1, 20000));
  command.add_option("-o,--output", arguments->output, "the plan to write, a .txtpb file; default: print it")
      ->check(output_file({".txtpb", kStandardOutput}));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return make(client, *arguments); }; });
}

}  // namespace glasswing
