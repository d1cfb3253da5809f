#include "core/design/plan_design.h"

#include <fmt/format.h>

#include <iostream>
#include <optional>

#include "client/plans/commands.h"
#include "client/plans/rig_limits.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"

namespace glasswing {
namespace {

struct PlanDesignArguments {
  RigLimitsArguments rig;
  DesignWish wish;
  std::optional<double> noise, full_well;
  std::string footprints = "gaussian", sigma_range, output = kStandardOutput;
};

// "0.3:4"
absl::Status read_sigma_range(const std::string& text, DesignWish& wish) {
  if (text.empty()) return absl::OkStatus();
  double low = 0.0, high = 0.0;
  if (!Scanner(text).number(low).then(":").number(high).done() ||
      !(low >= 0.05 && high >= low && high <= 1000.0)) {
    return absl::InvalidArgumentError(fmt::format(
        "--sigma-range is \"{}\"; it must be LOW:HIGH in monitor pixels, 0.05 to 1000, such as 0.3:4", text));
  }
  wish.prior = FootprintPrior{.modes = wish.modes, .low_px = low, .high_px = high};
  return absl::OkStatus();
}

std::string words_of(const ExpectedErrors& expected) {
  return fmt::format("centre {:.3g} px, width {:.3g} px, weight {:.3g}, composite {:.3g} ({:.1f} dB)",
                     expected.centre_px, expected.width_px, expected.weight, expected.composite,
                     -20.0 * std::log10(expected.composite));
}

absl::Status design(const Client& client, PlanDesignArguments arguments) {
  GW_RETURN_IF_ERROR(read_sigma_range(arguments.sigma_range, arguments.wish));
  GW_ASSIGN_OR_RETURN(const RigLimits rig, read_plan_limits(client, arguments.rig));
  if (rig.camera) {
    arguments.wish.noise = noise_of(rig.camera->camera());
  } else if (!arguments.noise) {
    return absl::InvalidArgumentError(
        "--noise is missing; give the camera's, such as 0.005, or --for-rig to use that of the rig's camera");
  }
  if (arguments.noise) arguments.wish.noise.read_sd = *arguments.noise;
  arguments.wish.any_footprints = arguments.footprints == "any";
  if (arguments.full_well) arguments.wish.noise.full_well = arguments.full_well;
  GW_ASSIGN_OR_RETURN(const DesignedPlan designed, design_plan(arguments.wish, rig));
  std::string text = plan_text(designed.plan, rig, "glasswing plan design");
  const DesignWish& wish = arguments.wish;
  const std::string expected = fmt::format(
      "For noise of {:g} of full scale{}, {} place{} per pixel, sigmas {:.3g} to {:.3g} px: {}.\n"
      "Expected standard deviations: {}\n",
      wish.noise.read_sd,
      wish.noise.full_well ? fmt::format(" and a full well of {:g} electrons", *wish.noise.full_well) : "",
      designed.prior.modes, designed.prior.modes == 1 ? "" : "s at most", designed.prior.low_px,
      designed.prior.high_px, designed.chosen, words_of(designed.expected));
  const std::string other = designed.other_expected ? fmt::format("The other way, {}: {}\n", designed.other,
                                                                  words_of(*designed.other_expected))
                                                    : "";
  std::string comment;
  for (size_t from = 0; from < expected.size();) {
    const size_t end = expected.find('\n', from);
    comment += "# " + expected.substr(from, end - from) + "\n";
    from = end + 1;
  }
  text.insert(text.find('\n') + 1, comment);
  GW_RETURN_IF_ERROR(write_output(arguments.output, text));
  std::cerr << expected << other;
  if (arguments.output != kStandardOutput) {
    std::cerr << fmt::format("{}: {} images with the object; for its cost: glasswing plan estimate {}\n",
                             arguments.output, images_of(designed.plan, rig), arguments.output);
  }
  return absl::OkStatus();
}

}  // namespace

void add_plan_design_command(CLI::App& plan, Client& client) {
  CLI::App& command = *plan.add_subcommand(
      "design", "Design the most informative plan for an image budget and a camera's noise.");
  command.footer(
      "Chooses sinusoids or stripes, their periods or widths, and directions, by their expected information; "
      "prints the expected standard deviations. Without --monitor the server's monitors are used; --for-rig "
      "also chooses exposures and hold_refreshes for its camera.\n\n"
      "Examples:\n"
      "  glasswing plan design --images 100 --noise 0.005 --monitor back:1920x1080 -o vase.txtpb\n"
      "  glasswing plan design --images 50 --for-rig\n"
      "  glasswing plan design --images 30 --noise 0.01 --modes 1 --sigma-range 0.5:10 --for-rig\n"
      "  glasswing plan design --images 100 --noise 0.005 --footprints any --monitor back:1920x1080");
  auto arguments = std::make_shared<PlanDesignArguments>();
  add_rig_limits_options(command, arguments->rig);
  command
      .add_option("--images", arguments->wish.images,
                  "total number, with and without the object, on all monitors, at each exposure")
      ->check(CLI::Range(kMinDesignImages, 20000))
      ->required();
  command
      .add_option("--noise", arguments->noise,
                  "standard deviation of a dark sample, as a fraction of full scale; default with --for-rig: "
                  "the camera's")
      ->check(CLI::Range(1e-5, 0.5));
  command
      .add_option("--full-well", arguments->full_well,
                  "electrons at full scale; default: the camera's with --for-rig, otherwise no photon noise")
      ->check(CLI::Range(10.0, 1e7));
  command.add_option("--modes", arguments->wish.modes, "maximum number of places that a pixel sees")
      ->check(CLI::Range(1, kMaxFootprints))
      ->capture_default_str();
  command.add_option(
      "--sigma-range", arguments->sigma_range,
      "LOW:HIGH, widths of footprints in monitor pixels; default: 0.3:4 for 128 px, wider for more");
  command
      .add_option("--footprints", arguments->footprints,
                  "gaussian, or any: sinusoids in many directions, for glasswing solve --set footprints=any")
      ->check(CLI::IsMember({"gaussian", "any"}))
      ->capture_default_str();
  command.add_option("-o,--output", arguments->output, "the plan to write, a .txtpb file; default: print it")
      ->check(output_file({".txtpb", kStandardOutput}));
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return design(client, *arguments); }; });
}

}  // namespace glasswing
