#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <iostream>
#include <string>
#include <vector>

#include "client/capture/commands.h"
#include "client/capture/watch.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct RetakeArguments {
  std::string session, steps;
  bool watch = false;
};

using Ranges = google::protobuf::RepeatedPtrField<v1::StepRange>;

// "10-211,300"
absl::StatusOr<Ranges> parse_steps(const std::string& text) {
  Ranges ranges;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ','))) {
    const std::vector<std::string> ends = absl::StrSplit(part, '-');
    int first = 0, last = 0;
    const bool numbers = ends.size() <= 2 && absl::SimpleAtoi(ends.front(), &first) &&
                         absl::SimpleAtoi(ends.back(), &last) && first >= 0 && first <= last;
    if (!numbers) {
      return absl::InvalidArgumentError(
          fmt::format("--steps is \"{}\"; it must be steps and ranges of steps, such as 10-211,300", text));
    }
    v1::StepRange& range = *ranges.Add();
    range.set_first(first);
    range.set_last(last);
  }
  return ranges;
}

Ranges lost_steps(const v1::Session& session) {
  Ranges lost;
  for (const v1::RigChange& change : session.rig_changes()) lost.MergeFrom(change.lost());
  return lost;
}

absl::Status retake(const Client& client, const RetakeArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::ResumeSessionRequest request;
  request.set_name(arguments.session);
  if (arguments.steps.empty()) {
    v1::GetSessionRequest get;
    get.set_name(arguments.session);
    GW_ASSIGN_OR_RETURN(const v1::GetSessionResponse found,
                        call(server, &v1::SessionService::Stub::GetSession, get));
    *request.mutable_retake() = lost_steps(found.session());
    if (request.retake().empty()) {
      return absl::FailedPreconditionError(fmt::format(
          "no disturbance of the rig spoiled steps of session {}; name steps with --steps, such as --steps "
          "10-211",
          arguments.session));
    }
  } else {
    GW_ASSIGN_OR_RETURN(*request.mutable_retake(), parse_steps(arguments.steps));
  }
  GW_ASSIGN_OR_RETURN(const v1::ResumeSessionResponse resumed,
                      call(server, &v1::SessionService::Stub::ResumeSession, request, kLongCallTimeout));
  if (!client.json) {
    std::cout << fmt::format("session {}: capturing steps {} again\n", arguments.session,
                             ranges_text(request.retake()));
  }
  if (arguments.watch) return follow_to_outcome(client, arguments.session);
  if (client.json) print_json(resumed.session());
  return absl::OkStatus();
}

}  // namespace

void add_retake_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("retake", "Recapture steps that a knock, a lamp or a door spoiled.");
  command.footer(
      "A running capture is stopped for this, and continues with these steps and the remaining ones. "
      "Their\n"
      "old frames are dropped. A session that is solved, copied or a video cannot be retaken.\n\n"
      "Example:\n  glasswing retake vase --watch");
  auto arguments = std::make_shared<RetakeArguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command.add_option(
      "--steps", arguments->steps,
      "steps to capture again, such as 10-211,300; default: those that the session's warnings name");
  command.add_flag("--watch", arguments->watch,
                   "wait until it is captured or done; any other outcome is a failure");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return retake(client, *arguments); }; });
}

}  // namespace glasswing
