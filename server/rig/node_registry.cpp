#include "server/rig/node_registry.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/name.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr nanoseconds kSilence = std::chrono::seconds(5);

bool has_left(const v1::Node& node, nanoseconds silent) {
  return node.kind() == v1::NODE_KIND_SOLVER && silent >= kForgotten;
}

}  // namespace

absl::Status NodeRegistry::add(const v1::RegisterRequest& request) {
  GW_RETURN_IF_ERROR(check_name("node", request.name()));
  if (request.kind() == v1::NODE_KIND_UNSPECIFIED || !v1::NodeKind_IsValid(request.kind())) {
    return absl::InvalidArgumentError("kind is not given; it must be display, camera or solver");
  }
  const std::lock_guard lock(mutex_);
  const nanoseconds now = now_();
  std::erase_if(entries_,
                [now](const auto& known) { return has_left(known.second.node, now - known.second.heard); });
  Entry& entry = entries_[request.name()];
  const bool taken = !entry.node.address().empty() && entry.node.address() != request.address() &&
                     now - entry.heard < kSilence;
  if (taken) {
    return absl::AlreadyExistsError(
        fmt::format("another node, at {1}, has the name \"{0}\"; give this one another --name",
                    request.name(), entry.node.address()));
  }
  entry.node.set_kind(request.kind());
  entry.node.set_name(request.name());
  entry.node.set_address(request.address());
  entry.node.set_version(request.version());
  entry.node.set_build(request.build());
  if (!request.detail().empty()) entry.node.set_detail(request.detail());
  *entry.node.mutable_health() = request.health();
  entry.solver = request.solver();
  entry.heard = now;
  return absl::OkStatus();
}

void NodeRegistry::note(const std::string& name, const std::string& doing) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found != entries_.end()) found->second.node.set_detail(doing);
}

void NodeRegistry::note_clock(const std::string& name, nanoseconds offset, nanoseconds bound) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found == entries_.end()) return;
  found->second.node.mutable_clock()->set_offset_ns(offset.count());
  found->second.node.mutable_clock()->set_bound_ns(bound.count());
  found->second.clock_measured = now_();
}

std::vector<RegisteredSolver> NodeRegistry::current() const {
  const nanoseconds now = now_();
  std::vector<RegisteredSolver> nodes;
  for (const auto& [name, entry] : entries_) {
    if (has_left(entry.node, now - entry.heard)) continue;
    nodes.push_back({.node = entry.node, .info = entry.solver});
    v1::Node& node = nodes.back().node;
    node.set_up(now - entry.heard < kSilence);
    if (!node.up()) node.clear_clock();
    if (node.has_clock())
      node.mutable_clock()->set_age_s(std::chrono::duration<double>(now - entry.clock_measured).count());
  }
  return nodes;
}

std::vector<RegisteredSolver> NodeRegistry::solvers() const {
  const std::lock_guard lock(mutex_);
  std::vector<RegisteredSolver> solvers = current();
  std::erase_if(solvers,
                [](const RegisteredSolver& solver) { return solver.node.kind() != v1::NODE_KIND_SOLVER; });
  return solvers;
}

std::vector<v1::Node> NodeRegistry::nodes() const {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Node> nodes;
  for (RegisteredSolver& known : current()) nodes.push_back(std::move(known.node));
  std::stable_sort(nodes.begin(), nodes.end(),
                   [](const v1::Node& a, const v1::Node& b) { return a.kind() < b.kind(); });
  return nodes;
}

std::vector<v1::Node> NodeRegistry::up(v1::NodeKind kind) const {
  std::vector<v1::Node> found = nodes();
  std::erase_if(found, [kind](const v1::Node& node) { return node.kind() != kind || !node.up(); });
  return found;
}

absl::StatusOr<v1::Node> NodeRegistry::camera() const {
  const std::vector<v1::Node> cameras = up(v1::NODE_KIND_CAMERA);
  if (cameras.empty()) return absl::UnavailableError("no camera node is up; start glasswing-camera");
  return cameras.front();
}

absl::StatusOr<std::vector<v1::Node>> NodeRegistry::displays() const {
  std::vector<v1::Node> displays = up(v1::NODE_KIND_DISPLAY);
  if (displays.empty()) return absl::UnavailableError("no display node is up; start glasswing-display");
  return displays;
}

}  // namespace glasswing
