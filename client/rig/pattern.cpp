#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::hours kLongest(24);

struct PatternArguments {
  std::string pattern;
  std::vector<std::string> monitors;
};

absl::Status show_pattern(const Client& client, const PatternArguments& arguments) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  v1::ShowPatternRequest request;
  request.set_pattern(arguments.pattern);
  for (const std::string& monitor : arguments.monitors) request.add_monitors(monitor);
  grpc::ClientContext context;
  set_deadline(context, kLongest);
  const auto reader = server.stub->ShowPattern(&context, request);
  for (v1::ShowPatternResponse response; reader->Read(&response);)
    std::cout << fmt::format("{} on {}; Ctrl-C ends it\n", arguments.pattern,
                             fmt::join(response.monitors(), ", "))
              << std::flush;
  return status_from(reader->Finish(), server.title);
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
