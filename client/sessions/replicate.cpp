#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/camera_argument.h"
#include "client/cli/rpc.h"
#include "client/sessions/commands.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

struct ReplicateArguments {
  std::string session, camera, node;
};

absl::Status replicate(const Client& client, const ReplicateArguments& arguments) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::ReplicateSessionRequest request;
  GW_ASSIGN_OR_RETURN(*request.mutable_name(), session_name_of(client, arguments.session, arguments.camera));
  request.set_node(arguments.node);
  grpc::ClientContext context;
  set_deadline(context, std::chrono::hours(24));
  const Interruptible ctrl_c([&context] { context.TryCancel(); });
  Progress progress("copying");
  const auto reader = server.stub->ReplicateSession(&context, request);
  v1::ReplicateSessionResponse copied;
  while (reader->Read(&copied)) {
    const double share = copied.byte_count() == 0 ? 1.0
                                                  : static_cast<double>(copied.bytes_done()) /
                                                        static_cast<double>(copied.byte_count());
    progress.update(share, fmt::format("{} of {} frames", copied.frames_done(), copied.frame_count()));
  }
  const grpc::Status status = reader->Finish();
  if (interrupted()) {
    return absl::CancelledError(
        "the copying was interrupted; what is copied is kept, and the same command copies the rest");
  }
  if (!status.ok()) return status_from(status, server.title);
  progress.done(fmt::format("{} frames", copied.frame_count()));
  if (client.json) {
    const nlohmann::ordered_json answer = {{"session", request.name()},
                                           {"node", arguments.node},
                                           {"frames", copied.frame_count()},
                                           {"bytes", copied.byte_count()}};
    std::cout << answer.dump(1) << "\n";
  } else {
    std::cout << fmt::format("session {} is on node {} too: {} frames, {}\n", request.name(), arguments.node,
                             copied.frame_count(), bytes_text(static_cast<double>(copied.byte_count())));
  }
  return absl::OkStatus();
}

}  // namespace

void add_replicate_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("replicate", "Copy a session's frames to another node.");
  command.footer(
      "Solvers then read from both nodes, and the frames survive the loss of one. The node is a camera, or "
      "a\n"
      "solver started with --listen and --archives. Repeat the command to finish an interrupted copy; that\n"
      "also repairs damaged frames on that node.\n\n"
      "Example:\n  glasswing replicate vase solver-2");
  auto arguments = std::make_shared<ReplicateArguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command.add_option("node", arguments->node, "the node for the copy; `glasswing nodes` lists them")
      ->required();
  add_view_option(command, arguments->camera);
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return replicate(client, *arguments); }; });
}

}  // namespace glasswing
