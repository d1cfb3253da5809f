#include <fmt/format.h>

#include <iostream>

#include "client/commands.h"
#include "client/output.h"
#include "client/rpc.h"
#include "core/base/status.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

absl::Status list_sessions(const Client& client) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                      call(server, &v1::SessionService::Stub::ListSessions, {}));
  if (client.json) {
    print_json(listed);
    return absl::OkStatus();
  }
  std::cout << fmt::format("{:24} {:10} {:21} {:>13} {:>9}  {}\n", "NAME", "STATE", "CREATED", "STEPS",
                           "TILES", "REASON");
  for (const v1::Session& session : listed.sessions()) {
    std::cout << fmt::format(
        "{:24} {:10} {:21} {:>13} {:>9}  {}\n", session.name(), state_name(session.state()),
        session.created(), fmt::format("{}/{}", session.proven_count(), session.step_count()),
        fmt::format("{}/{}", session.tiles_done(), session.tile_count()), session.reason());
  }
  return absl::OkStatus();
}

}  // namespace

void add_sessions_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("sessions", "List all sessions, newest first.");
  command.footer("Example:\n  glasswing sessions");
  command.callback([&client] { client.run = [&client] { return list_sessions(client); }; });
}

}  // namespace glasswing
