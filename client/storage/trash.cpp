#include <fmt/format.h>

#include <iostream>
#include <vector>

#include "client/cli/rpc.h"
#include "client/storage/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "glasswing/v1/storage_service.grpc.pb.h"

namespace glasswing {
namespace {

using Storage = Peer<v1::StorageService>;

// A rule may put thousands of sessions into the trash.
constexpr std::chrono::minutes kApplyTimeout(10);

absl::Status undelete(const Client& client, const std::vector<std::string>& sessions) {
  const Storage server(client.server_title(), client.server);
  for (const std::string& name : sessions) {
    v1::UndeleteSessionRequest request;
    request.set_name(name);
    GW_RETURN_IF_ERROR(call(server, &v1::StorageService::Stub::UndeleteSession, request).status());
    if (!client.json) std::cout << fmt::format("session {} is back, and the rules leave it alone\n", name);
  }
  return absl::OkStatus();
}

absl::Status apply_rules(const Client& client, bool dry_run) {
  const Storage server(client.server_title(), client.server);
  v1::ApplyRetentionRequest request;
  request.set_dry_run(dry_run);
  GW_ASSIGN_OR_RETURN(const v1::ApplyRetentionResponse applied,
                      call(server, &v1::StorageService::Stub::ApplyRetention, request, kApplyTimeout));
  if (client.json) {
    print_json(applied);
    return absl::OkStatus();
  }
  std::vector<std::vector<std::string>> rows;
  for (const v1::SessionEnding& ending : applied.endings()) {
    rows.push_back({ending.session(), ending.frames_only() ? "frames" : "session",
                    bytes_text(static_cast<double>(ending.bytes())), ending.why()});
  }
  print_table(client, {{"SESSION"}, {"WHAT"}, {"BYTES", true}, {"WHY"}}, rows);
  return absl::OkStatus();
}

}  // namespace

void add_undelete_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("undelete", "Take sessions out of the trash.");
  command.footer(
      "Also keeps frames that a rule would remove. The server's rules leave the sessions alone from then "
      "on.\n`glasswing du` says when they end.\n\n"
      "Example:\n  glasswing undelete vase");
  auto sessions = std::make_shared<std::vector<std::string>>();
  command.add_option("sessions", *sessions, "their names")->required();
  command.callback(
      [&client, sessions] { client.run = [&client, sessions] { return undelete(client, *sessions); }; });
}

void add_retention_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("retention", "Apply the server's rules by which sessions end, now.");
  command.footer(
      "The server does so every hour (glasswing-server --keep-newest, --keep-frames-days, --keep-tags). "
      "What a rule\nends can be had back for a day: glasswing undelete.\n\n"
      "Examples:\n  glasswing retention --dry-run\n  glasswing retention");
  auto dry_run = std::make_shared<bool>(false);
  command.add_flag("--dry-run", *dry_run, "list what would go, and change nothing");
  command.callback(
      [&client, dry_run] { client.run = [&client, dry_run] { return apply_rules(client, *dry_run); }; });
}

}  // namespace glasswing
