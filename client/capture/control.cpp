#include "client/capture/commands.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using Stub = v1::SessionService::Stub;

template <typename Request, typename Response>
void add(CLI::App& app, Client& client, const std::string& verb, const std::string& description,
         grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*)) {
  CLI::App& command = *app.add_subcommand(verb, description);
  command.footer("Example:\n  glasswing " + verb + " vase");
  auto name = std::make_shared<std::string>();
  command.add_option("session", *name, "the session's name")->required();
  command.callback([&client, name, rpc] {
    client.run = [&client, name, rpc]() -> absl::Status {
      const Peer<v1::SessionService> server(client.server_title(), client.server);
      Request request;
      request.set_name(*name);
      GW_ASSIGN_OR_RETURN(const Response response, call(server, rpc, request, kLongCallTimeout));
      print_session(response.session(), client.json);
      return absl::OkStatus();
    };
  });
}

}  // namespace

void add_control_commands(CLI::App& app, Client& client) {
  add(app, client, "pause",
      "Stop a capture after the current step, or a solve; proven steps and solved tiles are kept.",
      &Stub::PauseSession);
  add(app, client, "resume", "Continue a paused session with the steps or tiles that remain.",
      &Stub::ResumeSession);
  add(app, client, "cancel",
      "End a capture permanently and keep its frames; or end a solve and return to the previous matte.",
      &Stub::CancelSession);
}

}  // namespace glasswing
