#include "server/archives/replicas.h"

#include <fmt/format.h>

#include <algorithm>

namespace glasswing {
namespace {

v1::Node node_named(const std::string& name, const NodeRegistry& rig) {
  const std::vector<v1::Node> nodes = rig.nodes();
  const auto found = std::ranges::find(nodes, name, [](const v1::Node& node) { return node.name(); });
  return found == nodes.end() ? v1::Node() : *found;
}

}  // namespace

std::vector<std::string> replica_addresses(const v1::Session& session, const NodeRegistry& rig) {
  std::vector<std::string> addresses;
  for (const v1::ArchiveCopy& copy : session.copies()) {
    if (!is_whole(copy)) continue;
    const v1::Node node = node_named(copy.node(), rig);
    addresses.push_back(node.up() && !node.address().empty() ? node.address() : copy.address());
  }
  return addresses;
}

absl::StatusOr<std::string> keeper_address(const std::string& name, const NodeRegistry& rig) {
  const v1::Node node = node_named(name, rig);
  if (node.name().empty()) {
    return absl::NotFoundError(fmt::format("there is no node \"{}\"; `glasswing nodes` lists them", name));
  }
  if (!node.up())
    return absl::UnavailableError(fmt::format("node \"{}\" does not answer; start it again", name));
  if (node.kind() == v1::NODE_KIND_DISPLAY || node.address().empty()) {
    return absl::FailedPreconditionError(fmt::format(
        "node \"{}\" does not store archives; camera nodes do, and solvers with --listen and --archives",
        name));
  }
  return node.address();
}

}  // namespace glasswing
