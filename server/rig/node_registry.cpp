#include "server/rig/node_registry.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <memory>

#include "core/base/address.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/descriptor.h"

namespace glasswing {
namespace {

constexpr nanoseconds kSilence = std::chrono::seconds(5);
constexpr nanoseconds kAuditInterval = std::chrono::minutes(1);
constexpr int kProbe_ms = 1000;

bool has_left(const v1::Node& node, nanoseconds silent) {
  return node.kind() == v1::NODE_KIND_SOLVER && silent >= kForgotten;
}

}  // namespace

Role role_of(v1::NodeKind kind) {
  switch (kind) {
    case v1::NODE_KIND_DISPLAY:
      return Role::kDisplay;
    case v1::NODE_KIND_CAMERA:
      return Role::kCamera;
    default:
      return Role::kSolver;
  }
}

bool takes_connections(const std::string& address) {
  const absl::StatusOr<SocketAddresses> addresses = socket_addresses(address);
  if (!addresses.ok()) return false;
  const addrinfo* found = addresses->get();
  const Descriptor socket(::socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (::connect(socket.get(), found->ai_addr, found->ai_addrlen) == 0) return true;
  pollfd polled{socket.get(), POLLOUT, 0};
  if (errno != EINPROGRESS || ::poll(&polled, 1, kProbe_ms) != 1) return false;
  int failure = 0;
  socklen_t size = sizeof failure;
  return ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &failure, &size) == 0 && failure == 0;
}

absl::Status NodeRegistry::add(const v1::RegisterRequest& request,
                               const std::optional<CertifiedPeer>& caller) {
  GW_RETURN_IF_ERROR(check_name("node", request.name()));
  if (request.kind() == v1::NODE_KIND_UNSPECIFIED || !v1::NodeKind_IsValid(request.kind())) {
    return absl::InvalidArgumentError("kind is not given; it must be display, camera or solver");
  }
  // A solver may have none. gRPC would also accept others, such as "unix:/…".
  if (!request.address().empty()) GW_RETURN_IF_ERROR(parse_address(request.address()).status());
  if (const double done = request.preparation().done(); !(done >= 0.0 && done <= 1.0))
    return absl::InvalidArgumentError(fmt::format("preparation.done is {}; it must be 0 to 1", done));
  absl::Status taken = take(request, caller);
  if (!taken.ok()) audit_refusal(request, caller ? caller->name : "", taken);
  return taken;
}

absl::Status NodeRegistry::take(const v1::RegisterRequest& request,
                                const std::optional<CertifiedPeer>& caller) {
  const Roles needed = only(role_of(request.kind()));
  if (caller && (caller->roles & needed) == 0) {
    return absl::PermissionDeniedError(
        fmt::format("node \"{}\" registers as a {}; the certificate \"{}\" has the roles {}", request.name(),
                    names_of(needed), caller->name, names_of(caller->roles)));
  }
  std::unique_lock lock(mutex_);
  std::erase_if(entries_, [now = now_()](const auto& known) {
    return has_left(known.second.node, now - known.second.heard);
  });
  const auto known = entries_.find(request.name());
  std::string owner = names_.owner(request.name());
  if (owner.empty() && known != entries_.end()) owner = known->second.node.certificate();
  if (caller && !owner.empty() && owner != caller->name) {
    return absl::PermissionDeniedError(fmt::format(
        "the name \"{0}\" belongs to the certificate \"{1}\", not to \"{2}\"; give this node another --name, "
        "or release the name: glasswing nodes release {0}",
        request.name(), owner, caller->name));
  }
  GW_RETURN_IF_ERROR(check_free(request, lock));
  if (!entries_.contains(request.name()) && entries_.size() >= kMaxNodes) {
    return absl::ResourceExhaustedError(
        fmt::format("{} nodes are registered, the maximum; solvers are forgotten ten minutes after they end, "
                    "others with: glasswing nodes release NAME",
                    kMaxNodes));
  }
  if (caller && owner.empty() && request.kind() != v1::NODE_KIND_SOLVER)
    GW_RETURN_IF_ERROR(names_.give(request.name(), caller->name));
  Entry& entry = entries_[request.name()];
  const std::string certificate = caller ? caller->name : "";
  if (entry.node.name().empty() || entry.node.address() != request.address() ||
      entry.node.kind() != request.kind() || entry.node.certificate() != certificate) {
    spdlog::info("audit node registered name={} kind={} address={} before={} caller=\"{}\"", request.name(),
                 names_of(needed), request.address(), entry.node.address(), certificate);
  }
  if (entry.node.address() != request.address()) entry.clock_history.clear();
  entry.node.set_kind(request.kind());
  entry.node.set_name(request.name());
  entry.node.set_address(request.address());
  entry.node.set_version(request.version());
  entry.node.set_build(request.build());
  entry.node.set_certificate(certificate);
  if (!request.detail().empty()) entry.node.set_detail(request.detail());
  *entry.node.mutable_health() = request.health();
  entry.node.clear_preparation();
  if (request.has_preparation()) *entry.node.mutable_preparation() = request.preparation();
  entry.solver = request.solver();
  entry.heard = now_();
  return absl::OkStatus();
}

absl::Status NodeRegistry::check_free(const v1::RegisterRequest& request,
                                      std::unique_lock<std::mutex>& lock) const {
  const auto address_of = [&](const std::string& name) {
    const auto found = entries_.find(name);
    return found == entries_.end() ? "" : found->second.node.address();
  };
  const std::string address = address_of(request.name());
  if (address.empty() || address == request.address()) return absl::OkStatus();
  bool alive = now_() - entries_.at(request.name()).heard < kSilence;
  if (!alive) {
    lock.unlock();
    alive = is_alive_(address);
    lock.lock();
    alive = alive || address_of(request.name()) != address;  // another node was quicker
  }
  if (!alive) return absl::OkStatus();
  return absl::AlreadyExistsError(fmt::format(
      "another node, at {1}, has the name \"{0}\"; give this one another --name", request.name(), address));
}

void NodeRegistry::audit_refusal(const v1::RegisterRequest& request, const std::string& caller,
                                 const absl::Status& refused) {
  constexpr size_t kMaxRemembered = 1000;
  const std::string line = fmt::format("name={} kind={} address={} caller=\"{}\": {}", request.name(),
                                       names_of(only(role_of(request.kind()))), request.address(), caller,
                                       std::string(refused.message()));
  const std::lock_guard lock(mutex_);
  const nanoseconds now = now_();
  std::erase_if(audited_, [&](const auto& known) { return now - known.second >= kAuditInterval; });
  if (audited_.size() >= kMaxRemembered || !audited_.emplace(line, now).second) return;
  spdlog::warn("audit node refused {}", line);
}

absl::Status NodeRegistry::release(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found != entries_.end() && now_() - found->second.heard < kSilence) {
    return absl::FailedPreconditionError(fmt::format(
        "node \"{}\" is up, at {}; stop it before releasing its name", name, found->second.node.address()));
  }
  const absl::Status released = names_.release(name);
  if (absl::IsNotFound(released) && found == entries_.end())
    return absl::NotFoundError(fmt::format("there is no node \"{}\"; `glasswing nodes` lists them", name));
  if (!released.ok() && !absl::IsNotFound(released)) return released;
  entries_.erase(name);
  return absl::OkStatus();
}

absl::Status NodeRegistry::check_owner(const std::string& name,
                                       const std::optional<CertifiedPeer>& caller) const {
  if (!caller) return absl::OkStatus();
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found == entries_.end() || found->second.node.certificate() == caller->name) return absl::OkStatus();
  return absl::PermissionDeniedError(
      fmt::format("node \"{}\" is registered under the certificate \"{}\", not under \"{}\"", name,
                  found->second.node.certificate(), caller->name));
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
  const nanoseconds now = found->second.clock_measured = now_();
  std::deque<Entry::Measured>& history = found->second.clock_history;
  if (!history.empty() && now - history.back().at < kClockStep) return;
  if (history.size() == kClockSteps) history.pop_front();
  history.push_back({.at = now, .offset = offset, .bound = bound});
}

absl::StatusOr<std::vector<v1::ClockOffset>> NodeRegistry::clock_history(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found == entries_.end())
    return absl::NotFoundError(fmt::format("there is no node \"{}\"; `glasswing nodes` lists them", name));
  const nanoseconds now = now_();
  std::vector<v1::ClockOffset> history;
  for (const Entry::Measured& measured : found->second.clock_history) {
    const nanoseconds age = now - measured.at;
    if (age > kClockStep * kClockSteps) continue;  // of before the node was away
    v1::ClockOffset& offset = history.emplace_back();
    offset.set_offset_ns(measured.offset.count());
    offset.set_bound_ns(measured.bound.count());
    offset.set_age_s(std::chrono::duration<double>(age).count());
  }
  return history;
}

std::vector<RegisteredSolver> NodeRegistry::current() const {
  const nanoseconds now = now_();
  std::vector<RegisteredSolver> nodes;
  for (const auto& [name, entry] : entries_) {
    if (has_left(entry.node, now - entry.heard)) continue;
    nodes.push_back({.node = entry.node, .info = entry.solver});
    v1::Node& node = nodes.back().node;
    node.set_up(now - entry.heard < kSilence);
    if (!node.up()) {
      node.clear_clock();
      node.clear_preparation();
      node.set_away_since(utc_rfc3339_ago(now - entry.heard));
    }
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

absl::StatusOr<v1::Node> NodeRegistry::camera(const std::string& name) const {
  const std::vector<v1::Node> cameras = up(v1::NODE_KIND_CAMERA);
  if (!name.empty()) {
    const auto found = std::ranges::find(cameras, name, &v1::Node::name);
    if (found != cameras.end()) return *found;
    return absl::UnavailableError(
        fmt::format("camera node \"{}\" is not up; `glasswing nodes` lists all", name));
  }
  if (cameras.empty()) return absl::UnavailableError("no camera node is up; start glasswing-camera");
  if (cameras.size() == 1) return cameras.front();
  std::vector<std::string> all;
  for (const v1::Node& each : cameras)
    all.push_back(fmt::format("\"{}\" at {}", each.name(), each.address()));
  return absl::FailedPreconditionError(fmt::format(
      "the rig has {} cameras: {}; name the one to use, in a plan with camera: \"{}\", or stop the others",
      cameras.size(), fmt::join(all, " and "), cameras.front().name()));
}

absl::StatusOr<std::vector<v1::Node>> NodeRegistry::displays() const {
  std::vector<v1::Node> displays = up(v1::NODE_KIND_DISPLAY);
  if (displays.empty()) return absl::UnavailableError("no display node is up; start glasswing-display");
  return displays;
}

}  // namespace glasswing
