#include <fmt/format.h>

#include <iostream>

#include "client/cli/rpc.h"
#include "client/plans/estimate.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/service/preparation.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {
namespace {

const char* kind_name(v1::NodeKind kind) {
  switch (kind) {
    case v1::NODE_KIND_DISPLAY:
      return "display";
    case v1::NODE_KIND_CAMERA:
      return "camera";
    case v1::NODE_KIND_SOLVER:
      return "solver";
    default:
      return "unknown";
  }
}

// "12.5 ms +- 40 us", "-3 d 4 h +- 60 us": clocks count from their machine's boot.
std::string clock_text(const v1::Node& node) {
  if (!node.has_clock()) return "-";
  return fmt::format("{} +- {}", offset_text(static_cast<double>(node.clock().offset_ns())),
                     offset_text(static_cast<double>(node.clock().bound_ns())));
}

std::string disk_text(const v1::NodeHealth& health) {
  return health.total_bytes() == 0 ? "-" : bytes_text(static_cast<double>(health.free_bytes()));
}

std::string temperature_text(const v1::NodeHealth& health) {
  return health.has_temperature_c() ? fmt::format("{:.0f} C", health.temperature_c()) : "-";
}

std::string state_text(const v1::Node& node) {
  return node.has_preparation() ? "preparing" : node.up() ? "up" : "away";
}

// "simulating the scene, 37 %; sim 640x488 at 200 fps, scene crystal"
std::string detail_text(const v1::Node& node) {
  if (!node.has_preparation()) return node.detail();
  return fmt::format("{}; {}", preparation_text(node.preparation()), node.detail());
}

absl::Status list_nodes(const Client& client) {
  const Peer<v1::NodeService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListNodesResponse listed,
                      call_pages(server, &v1::NodeService::Stub::ListNodes, {}));
  if (client.json) {
    print_json(listed);
    return absl::OkStatus();
  }
  for (const std::string& problem : listed.problems())
    std::cerr << fmt::format("warning: {}\n", printable(problem));
  std::vector<std::vector<std::string>> rows;
  for (const v1::Node& node : listed.nodes()) {
    rows.push_back({kind_name(node.kind()), node.name(), state_text(node),
                    node.address().empty() ? "-" : node.address(), clock_text(node), disk_text(node.health()),
                    temperature_text(node.health()), detail_text(node)});
  }
  print_table(
      client,
      {{"KIND"}, {"NAME"}, {"STATE"}, {"ADDRESS"}, {"CLOCK AHEAD"}, {"DISK FREE"}, {"WARMEST"}, {"DETAIL"}},
      rows);
  if (listed.has_holder() && !client.tsv)
    std::cout << fmt::format("the rig is held by {}\n", printable(holder_text(listed.holder())));
  return absl::OkStatus();
}

absl::Status release_node(const Client& client, const std::string& name) {
  const Peer<v1::NodeService> server(client.server_title(), client.server);
  v1::ReleaseNodeRequest request;
  request.set_name(name);
  return call(server, &v1::NodeService::Stub::ReleaseNode, request).status();
}

}  // namespace

void add_nodes_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand("nodes", "List the rig's displays, cameras and solvers.");
  command.footer("Example:\n  glasswing nodes --json");
  command.callback([&client] { client.run = [&client] { return list_nodes(client); }; });
  CLI::App& release = *command.add_subcommand("release", "Forget an unreachable node, and release its name.");
  release.footer(
      "A display's or camera's name belongs to the certificate that registered it first. Once it is "
      "released, the\n"
      "next certificate may use it.\n\n"
      "Example:\n  glasswing nodes release camera-1");
  auto name = std::make_shared<std::string>();
  release.add_option("name", *name, "the node's name")->required();
  release.callback([&client, name] { client.run = [&client, name] { return release_node(client, *name); }; });
}

}  // namespace glasswing
