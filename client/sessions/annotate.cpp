#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>
#include <optional>

#include "client/cli/rpc.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

using Sessions = Peer<v1::SessionService>;

absl::StatusOr<v1::Session> annotated(const Client& client, const v1::AnnotateSessionRequest& request) {
  const Sessions server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::AnnotateSessionResponse answer,
                      call(server, &v1::SessionService::Stub::AnnotateSession, request));
  return answer.session();
}

absl::Status note(const Client& client, const std::string& name, const std::optional<std::string>& text) {
  v1::AnnotateSessionRequest request;
  request.set_name(name);
  if (text) request.set_note(*text);
  GW_ASSIGN_OR_RETURN(const v1::Session session, annotated(client, request));
  if (client.json) {
    print_json(session);
  } else if (!session.note().empty()) {
    const std::vector<std::string> lines = absl::StrSplit(session.note(), '\n');
    for (const std::string& line : lines) std::cout << printable(line) << "\n";
  }
  return absl::OkStatus();
}

struct Tags {
  std::string session;
  std::vector<std::string> add, remove;
};

absl::Status tag(const Client& client, const Tags& tags) {
  v1::AnnotateSessionRequest request;
  request.set_name(tags.session);
  request.mutable_add_tags()->Assign(tags.add.begin(), tags.add.end());
  request.mutable_remove_tags()->Assign(tags.remove.begin(), tags.remove.end());
  GW_ASSIGN_OR_RETURN(const v1::Session session, annotated(client, request));
  if (client.json) {
    print_json(session);
  } else if (!session.tags().empty()) {
    std::cout << printable(fmt::format("{}", fmt::join(session.tags(), " "))) << "\n";
  }
  return absl::OkStatus();
}

}  // namespace

void add_annotate_commands(CLI::App& app, Client& client) {
  CLI::App& note_command = *app.add_subcommand("note", "Set a session's note, or print it.");
  note_command.footer(
      "Examples:\n"
      "  glasswing note vase \"handle to the left, room light off\"\n"
      "  glasswing note vase\n"
      "  glasswing note vase \"\"                 removes it");
  auto name = std::make_shared<std::string>();
  auto text = std::make_shared<std::optional<std::string>>();
  note_command.add_option("session", *name, "the session's name")->required();
  note_command.add_option("text", *text, "the new note; without it, print the current one");
  note_command.callback(
      [&client, name, text] { client.run = [&client, name, text] { return note(client, *name, *text); }; });

  CLI::App& tag_command = *app.add_subcommand("tag", "Add or remove a session's tags, or print them.");
  tag_command.footer(
      "Examples:\n"
      "  glasswing tag vase lab3 glass\n"
      "  glasswing tag vase --remove glass\n"
      "  glasswing sessions --tag lab3");
  auto tags = std::make_shared<Tags>();
  tag_command.add_option("session", tags->session, "the session's name")->required();
  tag_command.add_option("tags", tags->add, "letters, digits, '.', '_' and '-'");
  tag_command.add_option("--remove", tags->remove, "a tag to remove; may be repeated")
      ->allow_extra_args(false);
  tag_command.callback([&client, tags] { client.run = [&client, tags] { return tag(client, *tags); }; });
}

}  // namespace glasswing
