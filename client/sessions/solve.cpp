#include "client/cli/output.h"
#include "client/cli/rpc.h"
#include "client/cli/settings.h"
#include "client/sessions/commands.h"
#include "client/sessions/watch.h"
#include "core/base/status.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct SolveArguments {
  std::string session;
  std::string method;
  std::vector<std::string> options;
  bool watch = false;
};

absl::Status solve(const Client& client, const SolveArguments& arguments) {
  v1::SolveSessionRequest request;
  request.set_name(arguments.session);
  request.set_method(arguments.method);
  GW_ASSIGN_OR_RETURN(const auto options, parse_settings(arguments.options));
  request.mutable_options()->insert(options.begin(), options.end());
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::SolveSessionResponse started,
                      call(server, &v1::SessionService::Stub::SolveSession, request, kLongCallTimeout));
  if (arguments.watch) return follow_to_outcome(client, arguments.session);
  print_session(started.session(), client.json);
  return absl::OkStatus();
}

}  // namespace

void add_solve_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("solve", "Solve a captured session.");
  command.footer(
      "Examples:\n  glasswing solve vase --watch\n"
      "  glasswing solve vase --method gaussian --set images=100\n"
      "  glasswing solve vase --method fringe --set modes=2");
  auto arguments = std::make_shared<SolveArguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command.add_option("--method", arguments->method, "the method; default: the plan's")
      ->check(CLI::IsMember(std::vector<std::string>(kMethods.begin(), kMethods.end())));
  command.add_option("--set", arguments->options, "KEY=VALUE, an option of the method; may be repeated")
      ->allow_extra_args(false);
  command.add_flag("--watch", arguments->watch, "wait until it is done; any other outcome is a failure");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return solve(client, *arguments); }; });
}

}  // namespace glasswing
