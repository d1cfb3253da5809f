#include <fmt/format.h>

#include <iostream>
#include <optional>

#include "client/capture/commands.h"
#include "client/capture/watch.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct RetryArguments {
  std::string session;
  std::optional<int> retries;
  bool watch = false;
};

void print_what_is_retried(const v1::Session& session) {
  const std::string& name = session.name();
  if (!session.refused_frames().empty()) {
    std::cout << fmt::format("session {}: solving frames {} again\n", name,
                             ranges_text(session.refused_frames()));
  } else if (session.job() != 0 && session.tile_count() == 0) {
    std::cout << fmt::format("session {}: solving it again from the start\n", name);
  } else if (session.job() != 0) {
    std::cout << fmt::format("session {}: solving the {} of {} tiles that are not done\n", name,
                             session.tile_count() - session.tiles_done(), session.tile_count());
  } else {
    std::cout << fmt::format("session {}: showing the {} of {} steps that are not proven\n", name,
                             session.step_count() - session.proven_count(), session.step_count());
    for (const v1::UnprovenStep& step : session.unproven())
      std::cout << fmt::format("  {:5}  {}\n", step.step(), printable(step.what()));
  }
}

absl::Status retry(const Client& client, const RetryArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::GetSessionRequest get;
  get.set_name(arguments.session);
  GW_ASSIGN_OR_RETURN(const v1::GetSessionResponse found,
                      call(server, &v1::SessionService::Stub::GetSession, get));
  if (!allows(found.session(), v1::SESSION_ACTION_RETRY)) {
    return absl::FailedPreconditionError(fmt::format("session {} is {}; only a failed one can be retried",
                                                     arguments.session, state_name(found.session().state())));
  }
  v1::ResumeSessionRequest request;
  request.set_name(arguments.session);
  if (arguments.retries) request.set_retries(*arguments.retries);
  GW_ASSIGN_OR_RETURN(const v1::ResumeSessionResponse resumed,
                      call(server, &v1::SessionService::Stub::ResumeSession, request, kLongCallTimeout));
  if (!client.json) print_what_is_retried(found.session());
  if (arguments.watch) return follow_to_outcome(client, arguments.session);
  if (client.json) print_json(resumed.session());
  return absl::OkStatus();
}

}  // namespace

void add_retry_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "retry", "Retry the failed parts: steps without proof, or tiles or frames that were not solved.");
  command.footer(
      "Proven steps and solved tiles are kept. To solve with other options: glasswing solve.\n\n"
      "Example:\n  glasswing retry vase --retries 30 --watch");
  auto arguments = std::make_shared<RetryArguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command
      .add_option("--retries", arguments->retries,
                  "how often a step may be shown again from now on; default: the plan's")
      ->check(CLI::Range(0, 100));
  command.add_flag("--watch", arguments->watch,
                   "wait until it is captured or done; any other outcome is a failure");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return retry(client, *arguments); }; });
}

}  // namespace glasswing
