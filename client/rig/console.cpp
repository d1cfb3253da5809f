#include <fmt/format.h>

#include <cstdlib>
#include <iostream>

#include "client/cli/output.h"
#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "glasswing/v1/console_service.grpc.pb.h"

namespace glasswing {
namespace {

// The user's name if it is valid in a token.
std::string own_name() {
  const char* user = std::getenv("USER");
  return user != nullptr && check_name("visitor", user).ok() ? user : "console";
}

struct ConsoleArguments {
  std::string name = own_name();
  bool viewer = false;
  double hours = 12.0;
};

absl::Status make_token(const Client& client, const ConsoleArguments& arguments) {
  const Peer<v1::ConsoleService> server(client.server_title(), client.server);
  v1::CreateTokenRequest request;
  request.set_name(arguments.name);
  request.set_role(arguments.viewer ? "viewer" : "operator");
  request.set_valid_hours(arguments.hours);
  GW_ASSIGN_OR_RETURN(const v1::CreateTokenResponse made,
                      call(server, &v1::ConsoleService::Stub::CreateToken, request));
  if (client.json) {
    print_json(made);
    return absl::OkStatus();
  }
  std::cout << fmt::format("{}/#token={}\n", made.url(), made.token()) << std::flush;
  std::cerr << fmt::format("the link logs in as {} until {}\n", arguments.viewer ? "a viewer" : "an operator",
                           made.expires());
  return absl::OkStatus();
}

}  // namespace

void add_console_command(CLI::App& app, Client& client) {
  CLI::App& console = *app.add_subcommand("console", "Access the rig's web console.");
  console.require_subcommand(1);
  console.footer("Example:\n  glasswing console token --viewer");
  CLI::App& command = *console.add_subcommand("token", "Make a link that logs a browser in to the console.");
  command.footer(
      "Treat the link as a password until it expires. A single link cannot be revoked: to void all of them,\n"
      "remove console-key from the server's data and restart the server.\n\n"
      "Examples:\n"
      "  glasswing console token\n"
      "  glasswing console token --viewer --name visitors --hours 8");
  auto arguments = std::make_shared<ConsoleArguments>();
  command.add_option("--name", arguments->name, "the owner's name, for the audit log and other users")
      ->capture_default_str();
  command.add_flag("--viewer", arguments->viewer, "allow looking only");
  command.add_option("--hours", arguments->hours, "hours until it expires")
      ->check(CLI::Range(0.01, 8760.0))
      ->capture_default_str();
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return make_token(client, *arguments); }; });
}

}  // namespace glasswing
