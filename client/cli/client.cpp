#include "client/cli/client.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdlib>

#include "client/cli/caller_metadata.h"
#include "core/base/address.h"
#include "core/security/tls.h"

namespace glasswing {
namespace {

absl::Status configure(Client& client, const Config& config) {
  client.server = config["server"];
  if (const absl::Status parsed = parse_address(client.server).status(); !parsed.ok())
    return absl::InvalidArgumentError(fmt::format("--server: {}", std::string(parsed.message())));
  // The first call reports what is wrong with the files; commands that make no calls do not need them.
  (void)use_tls({config["ca"], config["certificate"], config["key"]});
  return absl::OkStatus();
}

// A verb's status, with advice if the server does not answer.
absl::Status advised(const Client& client, const absl::Status& status) {
  if (status.message() != client.server_title() + " does not answer") return status;
  return absl::Status(status.code(),
                      fmt::format("{}; start glasswing-server there, or name another with --server",
                                  std::string(status.message())));
}

}  // namespace

std::vector<Setting> call_settings() {
  return {
      {.key = "server",
       .environment = "GLASSWING_SERVER",
       .value = "127.0.0.1:7440",
       .type = "ADDRESS",
       .help = "HOST:PORT of glasswing-server (default: 127.0.0.1:7440)"},
      {.key = "ca",
       .environment = "GLASSWING_CA",
       .type = "FILE",
       .help = "PEM of the CA that signed the certificates of server and nodes; calls then use TLS, which "
               "other machines require"},
      {.key = "certificate",
       .environment = "GLASSWING_CERTIFICATE",
       .type = "FILE",
       .help = "PEM of your own certificate, for a server that authenticates its callers"},
      {.key = "key",
       .environment = "GLASSWING_KEY",
       .type = "FILE",
       .help = "PEM of that certificate's key"}};
}

int run_client(int argc, const char* const* argv, const AddCommands& add_commands) {
  ::setenv("GRPC_VERBOSITY", "NONE", 0);  // we report each failure once
  spdlog::set_level(spdlog::level::off);  // logs are for daemons
  send_caller_metadata();
  Client client;
  const Program program = {
      .name = "glasswing",
      .description = "Captures environment mattes and composites the object over other pictures.",
      .footer =
          "Examples:\n"
          "  glasswing capture deploy/plans/crystal.txtpb --session vase --watch\n"
          "  glasswing solve vase --watch\n"
          "  glasswing fetch vase -o vase.exr\n"
          "  glasswing composite vase.exr --background harbour.png -o vase.png",
      .settings = call_settings(),
      .add_commands = [&](CLI::App& app, const Config& config) { add_commands(app, client, config); },
      .configure =
          [&](const Config& config) {
            client.run = [&client, run = std::move(client.run)] { return advised(client, run()); };
            return configure(client, config);
          }};
  return run_command_line(argc, argv, program, client);
}

}  // namespace glasswing
