#include <fmt/format.h>

#include <iostream>

#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::hours kLongestCapture(24);

const char* outcome_text(const v1::StepEvent& event) {
  switch (event.outcome()) {
    case v1::STEP_OUTCOME_SHOWN:
      return "shown";
    case v1::STEP_OUTCOME_PROVEN:
      return event.proof() == v1::PROOF_TIME_AND_PATCH ? "proven by time and id patch"
             : event.proof() == v1::PROOF_IMPORTED     ? "imported"
                                                       : "proven by time alone";
    case v1::STEP_OUTCOME_RETAKEN:
      return "retaken";
    case v1::STEP_OUTCOME_LOST:
      return "lost";
    default:
      return "unknown";
  }
}

absl::Status list_steps(const Client& client, const std::string& name, const std::string& camera) {
  GW_ASSIGN_OR_RETURN(const std::string session, session_name_of(client, name, camera));
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::WatchStepsRequest request;
  request.set_name(session);
  grpc::ClientContext context;
  set_deadline(context, kLongestCapture);
  const auto reader = server.stub->WatchSteps(&context, request);
  for (v1::WatchStepsResponse response; reader->Read(&response);) {
    if (client.json) {
      print_json(response);
      continue;
    }
    for (const v1::StepEvent& event : response.events()) {
      const std::string more = event.why().empty() ? event.file() : event.why();
      std::cout << fmt::format("{:9.3f} s  step {:5}  {}{}{}\n", event.seconds(), event.step(),
                               outcome_text(event), more.empty() ? "" : ": ", printable(more));
    }
    std::cout << std::flush;
  }
  return status_from(reader->Finish(), server.title);
}

}  // namespace

void add_steps_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("steps", "List the outcome of each step of a capture, and why steps were retaken.");
  command.footer(
      "Follows a running capture to its end. After a restart of the server, only the proven steps of earlier "
      "captures are known.\n\n"
      "Examples:\n"
      "  glasswing steps vase\n"
      "  glasswing steps vase --camera left\n"
      "  glasswing steps vase | grep retaken");
  auto name = std::make_shared<std::string>(), camera = std::make_shared<std::string>();
  command.add_option("session", *name, "the session's name")->required();
  command.add_option("--camera", *camera, "of a session with several cameras, this one")->type_name("CAMERA");
  command.callback([&client, name, camera] {
    client.run = [&client, name, camera] { return list_steps(client, *name, *camera); };
  });
}

}  // namespace glasswing
