#include "client/exchange/layout_list.h"

#include <fmt/format.h>

#include <iostream>
#include <utility>

#include "client/cli/monitor_argument.h"
#include "client/layouts/layout_guess.h"
#include "client/layouts/photograph_files.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr const char* kAuto = "auto";

absl::StatusOr<v1::Monitor> only_monitor(const PhotographOptions& options) {
  if (options.monitors.size() == 1) return parse_monitor_argument(options.monitors.front());
  return absl::InvalidArgumentError(fmt::format(
      "--monitor is given {} times; --layout needs it once, such as 1920x1080: photographs do not show how "
      "many pixels a monitor has",
      options.monitors.size()));
}

absl::StatusOr<LayoutFacts> facts_of(const LayoutOptions& options) {
  if (options.order || options.inverse || options.steps || options.phase_deg) {
    return absl::InvalidArgumentError(
        "--order, --inverse, --steps and --phase require a named layout; --layout auto takes only --periods, "
        "--shift and --cell");
  }
  LayoutFacts facts;
  facts.cell_px = options.cell_px;
  if (options.periods) {
    GW_ASSIGN_OR_RETURN(facts.periods, periods_of(*options.periods));
  }
  if (options.shift) {
    GW_ASSIGN_OR_RETURN(facts.backward, is_backward(*options.shift));
  }
  return facts;
}

absl::StatusOr<PhotographLayout> guess(const std::filesystem::path& directory,
                                       const std::vector<std::string>& files, const v1::Monitor& monitor,
                                       const LayoutOptions& options, std::optional<int> white,
                                       std::optional<StackSamples>& samples) {
  GW_ASSIGN_OR_RETURN(const LayoutFacts facts, facts_of(options));
  GW_ASSIGN_OR_RETURN(samples, sample_stack(directory, files, white));
  if (!white) GW_RETURN_IF_ERROR(check_white(directory, samples->largest_code, samples->bits));
  LayoutGuess guessed = guess_layout(*samples, files, monitor, facts);
  for (const std::string& reason : guessed.reasons) std::cerr << fmt::format("auto: {}\n", reason);
  constexpr int kFewBits = 16383;  // those of 14
  if (guessed.layout.ok() || samples->largest_code > kFewBits) return std::move(guessed.layout);
  return absl::Status(
      guessed.layout.status().code(),
      fmt::format("{}. No code is above {} of 65535; if the camera has fewer bits, pass --white, for example "
                  "--white 1023",
                  std::string(guessed.layout.status().message()), samples->largest_code));
}

}  // namespace

absl::StatusOr<LaidOutList> list_by_layout(const std::filesystem::path& directory, const std::string& files,
                                           const LayoutOptions& layout, const PhotographOptions& options) {
  LaidOutList result;
  GW_ASSIGN_OR_RETURN(const v1::Monitor monitor, only_monitor(options));
  GW_ASSIGN_OR_RETURN(const std::vector<std::string> photographs, photographs_in(directory, files));
  GW_ASSIGN_OR_RETURN(const PhotographLayout order,
                      layout.layout == kAuto
                          ? guess(directory, photographs, monitor, layout, options.white, result.samples)
                          : layout_of(layout));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Frame> frames, frames_of(order, monitor, photographs));
  PhotographList& list = result.list;
  list.path = directory;
  list.manifest.set_format_version(1);
  *list.manifest.add_monitors() = monitor;
  for (const v1::Frame& frame : frames) *list.manifest.add_frames() = frame;
  list.response = options.response.value_or("");
  list.black = options.black.value_or(0.0);
  list.white = options.white;
  return result;
}

}  // namespace glasswing
