#include <fmt/format.h>

#include <cstdlib>
#include <iostream>

#include "client/cli/rpc.h"
#include "client/rig/commands.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/cli/output.h"
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
  std::cerr << fmt::format(
      "the link logs in as {} until {}; to end it earlier: glasswing console revoke {}\n",
      arguments.viewer ? "a viewer" : "an operator", made.expires(), made.id());
  return absl::OkStatus();
}

absl::Status list_tokens(const Client& client) {
  const Peer<v1::ConsoleService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListTokensResponse listed,
                      call(server, &v1::ConsoleService::Stub::ListTokens, {}));
  if (client.json) {
    print_json(listed);
    return absl::OkStatus();
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::ConsoleToken& token : listed.tokens()) {
    rows.push_back({token.id(), token.name(), token.role(), token.expires(),
                    std::to_string(token.login_count()), token.made_by()});
  }
  print_table(client, {{"ID"}, {"NAME"}, {"ROLE"}, {"EXPIRES"}, {"LOGINS", true}, {"MADE BY"}}, rows);
  return absl::OkStatus();
}

absl::Status revoke_tokens(const Client& client, const std::vector<std::string>& ids) {
  const Peer<v1::ConsoleService> server(client.server_title(), client.server);
  for (const std::string& id : ids) {
    v1::RevokeTokenRequest request;
    request.set_id(id);
    GW_RETURN_IF_ERROR(call(server, &v1::ConsoleService::Stub::RevokeToken, request).status());
  }
  return absl::OkStatus();
}

void add_token_command(CLI::App& console, Client& client) {
  CLI::App& command = *console.add_subcommand("token", "Make a link that logs a browser in to the console.");
  command.footer(
      "Treat the link as a password until it expires; `glasswing console revoke` ends it earlier. It expires "
      "with\n"
      "your own certificate at the latest.\n\n"
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

void add_revoke_command(CLI::App& console, Client& client) {
  CLI::App& command = *console.add_subcommand("revoke", "Revoke tokens, and end every login made with them.");
  command.footer(
      "Tokens made with a revoked token are revoked too.\n\n"
      "Example:\n  glasswing console revoke 5f3a09c2d81e");
  auto ids = std::make_shared<std::vector<std::string>>();
  command.add_option("id", *ids, "of a token, from `glasswing console tokens`")->required();
  command.callback([&client, ids] { client.run = [&client, ids] { return revoke_tokens(client, *ids); }; });
}

}  // namespace

void add_console_command(CLI::App& app, Client& client) {
  CLI::App& console = *app.add_subcommand("console", "Access the rig's web console.");
  console.require_subcommand(1);
  console.footer("Example:\n  glasswing console token --viewer");
  add_token_command(console, client);
  CLI::App& tokens = *console.add_subcommand("tokens", "List the tokens that are valid.");
  tokens.footer("Example:\n  glasswing console tokens --json");
  tokens.callback([&client] { client.run = [&client] { return list_tokens(client); }; });
  add_revoke_command(console, client);
}

}  // namespace glasswing
