#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "client/rig/commands.h"
#include "client/rig/shown_pattern.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

struct PatternArguments {
  std::string pattern;
  std::vector<std::string> monitors;
};

absl::Status show_pattern(const Client& client, const PatternArguments& arguments) {
  ShownPattern shown(client, arguments.pattern, arguments.monitors);
  GW_ASSIGN_OR_RETURN(const std::vector<std::string> monitors, shown.wait());
  std::cout << fmt::format("{} on {}; Ctrl-C ends it\n", arguments.pattern, fmt::join(monitors, ", "))
            << std::flush;
  return shown.wait_for_end();
}

}  // namespace

void add_pattern_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("pattern", "Show a test pattern on the monitors until interrupted.");
  command.footer(
      "The rig is held meanwhile; `glasswing preview` works at the same time.\n\n"
      "Examples:\n"
      "  glasswing pattern white\n"
      "  glasswing pattern bars --monitor left");
  auto arguments = std::make_shared<PatternArguments>();
  command.add_option("pattern", arguments->pattern, "white, gray, bars, lines (to focus on), ramp or black")
      ->required();
  command.add_option("--monitor", arguments->monitors, "only this monitor; may be repeated");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return show_pattern(client, *arguments); };
  });
}

}  // namespace glasswing
