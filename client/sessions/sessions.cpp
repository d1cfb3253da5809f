#include <absl/time/clock.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/cli/time_argument.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct SessionsArguments {
  std::string text, since, before;
  std::vector<std::string> tags, states;
};

// All states by state_name().
std::map<std::string, v1::SessionState> states() {
  std::map<std::string, v1::SessionState> states;
  for (int state = v1::SESSION_STATE_CREATED; v1::SessionState_IsValid(state); ++state)
    states[state_name(static_cast<v1::SessionState>(state))] = static_cast<v1::SessionState>(state);
  return states;
}

absl::StatusOr<v1::ListSessionsRequest> request_of(const SessionsArguments& arguments) {
  v1::ListSessionsRequest request;
  request.set_text(arguments.text);
  request.mutable_tags()->Assign(arguments.tags.begin(), arguments.tags.end());
  for (const std::string& state : arguments.states) request.add_states(states().at(state));
  const absl::Time now = absl::Now();
  if (!arguments.since.empty()) {
    GW_ASSIGN_OR_RETURN(*request.mutable_created_from(),
                        parse_time_argument("--since", arguments.since, now));
  }
  if (!arguments.before.empty()) {
    GW_ASSIGN_OR_RETURN(*request.mutable_created_before(),
                        parse_time_argument("--before", arguments.before, now));
  }
  return request;
}

absl::Status list_sessions(const Client& client, const SessionsArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsRequest request, request_of(arguments));
  GW_ASSIGN_OR_RETURN(const v1::ListSessionsResponse listed,
                      call_pages(server, &v1::SessionService::Stub::ListSessions, request));
  if (client.json) {
    print_json(listed);
    return absl::OkStatus();
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::Session& session : listed.sessions()) {
    const std::string cameras =
        session.views().empty() ? "" : fmt::format(" of {} cameras", session.views_size());
    rows.push_back({session.name(), state_name(session.state()), session.created(),
                    fmt::format("{}/{}{}{}", session.proven_count(), session.step_count(),
                                session.time_proven_count() > 0 ? " by time" : "", cameras),
                    fmt::format("{}/{}", session.tiles_done(), session.tile_count()),
                    bytes_text(static_cast<double>(session.archive_bytes())),
                    fmt::format("{}", fmt::join(session.tags(), " ")), session.note(),
                    session.has_waiting() ? "waits: " + session.waiting().what() : session.reason(),
                    session.verdict().outlier() ? "unusual: " + session.verdict().text() : ""});
  }
  print_table(client,
              {{"NAME"},
               {"STATE"},
               {"CREATED"},
               {"STEPS", true},
               {"TILES", true},
               {"FRAMES", true},
               {"TAGS"},
               {"NOTE"},
               {"REASON"},
               {"QUALITY"}},
              rows);
  return absl::OkStatus();
}

}  // namespace

void add_sessions_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("sessions", "List all sessions, or those that match, newest first.");
  command.footer(
      "Times are UTC.\n\n"
      "Examples:\n"
      "  glasswing sessions\n"
      "  glasswing sessions vase --state done --since 7d\n"
      "  glasswing sessions --tag lab3 --tag vases --since 2026-11-01 --before 2026-12-01");
  auto arguments = std::make_shared<SessionsArguments>();
  command.add_option("text", arguments->text, "text in the name, the note, a tag or the reason");
  command.add_option("--tag", arguments->tags, "only sessions with this tag; repeat to require several")
      ->allow_extra_args(false);
  std::vector<std::string> names;
  for (const auto& [name, state] : states()) names.push_back(name);
  command.add_option("--state", arguments->states, "only sessions in this state; repeat to allow several")
      ->allow_extra_args(false)
      ->check(CLI::IsMember(names));
  command.add_option("--since", arguments->since,
                     "created at or after: 7d, 12h, 2026-11-01 or 2026-11-01T12:00:00Z");
  command.add_option("--before", arguments->before, "created before");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return list_sessions(client, *arguments); };
  });
}

}  // namespace glasswing
