#include <fmt/format.h>
#include <unistd.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kDeleteTimeout(6);

using Sessions = Peer<v1::SessionService>;

struct DeleteArguments {
  std::vector<std::string> sessions;
  std::string camera;
  bool yes = false, now = false;
};

std::string mattes_text(const v1::Session& session) {
  if (!session.solved_frames().empty()) return fmt::format(", {} mattes", session.solved_frames_size());
  return session.matte_ready() ? ", a matte" : "";
}

// FAILED_PRECONDITION if any of them cannot be deleted now; then none is deleted.
absl::StatusOr<std::vector<v1::Session>> deletable_sessions(const Client& client,
                                                            const DeleteArguments& arguments) {
  std::vector<v1::Session> sessions;
  for (const std::string& name : arguments.sessions) {
    absl::StatusOr<v1::Session> found = session_of(client, name, arguments.camera);
    if (arguments.now && absl::IsNotFound(found.status())) {  // perhaps in the trash
      sessions.emplace_back().set_name(name);
      continue;
    }
    GW_RETURN_IF_ERROR(found.status());
    if (!allows(*found, v1::SESSION_ACTION_DELETE)) {
      return absl::FailedPreconditionError(fmt::format(
          "session {0} is {1}; wait for it, or cancel it first: glasswing cancel {0}; nothing was deleted",
          found->name(), state_name(found->state())));
    }
    sessions.push_back(*std::move(found));
  }
  return sessions;
}

std::string what_became_of(const std::string& session, const v1::DeleteSessionResponse& answer) {
  if (!answer.ends().empty()) {
    return fmt::format("session {0} is in the trash until {1}; take it back: glasswing undelete {0}\n",
                       session, answer.ends());
  }
  return fmt::format("session {} is deleted: {} freed\n", session,
                     bytes_text(static_cast<double>(answer.freed_bytes())));
}

absl::Status confirm(const std::vector<v1::Session>& sessions, bool now) {
  if (::isatty(STDIN_FILENO) == 0) {
    return absl::FailedPreconditionError(
        fmt::format("--yes is needed to delete {} without a terminal; nothing was deleted",
                    sessions.size() == 1 ? "session " + sessions[0].name()
                                         : fmt::format("{} sessions", sessions.size())));
  }
  for (const v1::Session& session : sessions) {
    std::cerr << fmt::format("{}: {} frames, {}{}\n", session.name(), session.proven_count(),
                             bytes_text(static_cast<double>(session.archive_bytes())), mattes_text(session));
  }
  std::cerr << (now ? "Delete for good? [y/N] " : "Delete? [y/N] ");
  std::string answer;
  std::getline(std::cin, answer);
  if (answer == "y" || answer == "Y" || answer == "yes") return absl::OkStatus();
  return absl::CancelledError("nothing was deleted");
}

absl::Status delete_sessions(const Client& client, const DeleteArguments& arguments) {
  const Sessions server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, deletable_sessions(client, arguments));
  if (!arguments.yes) GW_RETURN_IF_ERROR(confirm(sessions, arguments.now));
  nlohmann::ordered_json deleted = nlohmann::ordered_json::array();
  absl::Status status;
  for (const v1::Session& session : sessions) {
    v1::DeleteSessionRequest request;
    request.set_name(session.name());
    request.set_trash(!arguments.now);
    const absl::StatusOr<v1::DeleteSessionResponse> answer =
        call(server, &v1::SessionService::Stub::DeleteSession, request, kDeleteTimeout);
    if (!answer.ok()) {
      status =
          absl::Status(answer.status().code(),
                       fmt::format("session {} was not deleted{}: {}", session.name(),
                                   session.name() == sessions.back().name() ? "" : ", nor those after it",
                                   std::string(answer.status().message())));
      break;
    }
    deleted.push_back(
        {{"session", session.name()}, {"freed_bytes", answer->freed_bytes()}, {"ends", answer->ends()}});
    if (!client.json) std::cout << what_became_of(session.name(), *answer);
  }
  if (client.json) std::cout << nlohmann::ordered_json{{"deleted", deleted}}.dump(1) << "\n";
  return status;
}

}  // namespace

void add_delete_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("delete", "Delete sessions, their frames and their mattes.");
  command.footer(
      "They stay in the trash for a day, and keep their disk space and their names until then. On a terminal "
      "it asks for\nconfirmation. Repeat an interrupted deletion to finish it.\n\n"
      "Examples:\n  glasswing delete vase\n  glasswing delete vase vase-2 --yes\n"
      "  glasswing delete vase --camera left\n  glasswing delete vase --now");
  auto arguments = std::make_shared<DeleteArguments>();
  command.add_option("sessions", arguments->sessions, "their names")->required();
  add_view_option(command, arguments->camera);
  command.add_flag("--now", arguments->now, "for good, also of sessions in the trash");
  command.add_flag("--yes", arguments->yes, "do not ask for confirmation");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return delete_sessions(client, *arguments); };
  });
}

}  // namespace glasswing
