// The nodes that have registered, and when each was last heard from.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/security/peer.h"
#include "glasswing/v1/node_service.pb.h"
#include "server/rig/node_names.h"

namespace glasswing {

// Nodes answer most calls at once; see NodeLink::call() for others.
inline constexpr std::chrono::seconds kNodeCall(10);

// A solver that is silent for this long is forgotten. Displays and cameras belong to the rig: they stay
// listed, as unavailable.
inline constexpr nanoseconds kForgotten = std::chrono::minutes(10);

// The role that a node of this kind must have.
Role role_of(v1::NodeKind kind);

// True if a connection to host:port is accepted within a second, as by a process that still listens there.
bool takes_connections(const std::string& address);

struct RegisteredSolver {
  v1::Node node;
  v1::SolverInfo info;
};

// Thread-safe.
class NodeRegistry {
 public:
  static constexpr size_t kMaxNodes = 1000;
  using Now = std::function<nanoseconds()>;
  using IsAlive = std::function<bool(const std::string& address)>;

  explicit NodeRegistry(NodeNames names = {}, Now now = monotonic_now, IsAlive is_alive = takes_connections)
      : now_(std::move(now)), is_alive_(std::move(is_alive)), names_(std::move(names)) {}

  // How long a node may take to answer before a call is repeated (NodeLink). Set before the first call.
  void set_call_time(std::chrono::milliseconds time) { call_time_ = time; }
  std::chrono::milliseconds call_time() const { return call_time_; }

  // Registers a node, or renews its registration. `caller`: whose certificate registers it; none without TLS.
  // INVALID_ARGUMENT: name, kind or preparation. PERMISSION_DENIED: the certificate lacks the kind's role, or
  // another one owns the name. ALREADY_EXISTS: a node that is alive at another address has the name.
  // RESOURCE_EXHAUSTED: kMaxNodes are known. Refusals and changes are audited.
  absl::Status add(const v1::RegisterRequest& node, const std::optional<CertifiedPeer>& caller);
  // Forgets a node and who owns its name, so that another certificate may use it. NOT_FOUND: no such node.
  // FAILED_PRECONDITION: it is up.
  absl::Status release(const std::string& name);
  // PERMISSION_DENIED: a node of this name is registered under another certificate.
  absl::Status check_owner(const std::string& name, const std::optional<CertifiedPeer>& caller) const;
  // Called when a solver claims a tile; `doing` is its activity as `glasswing nodes` shows it.
  void note(const std::string& name, const std::string& doing);

  // Measured now: the node's clock is ahead by `offset`, within `bound`.
  void note_clock(const std::string& name, nanoseconds offset, nanoseconds bound);
  // One measurement for each kClockStep of the last kClockSteps of them, oldest first. NOT_FOUND.
  static constexpr nanoseconds kClockStep = std::chrono::seconds(10);
  static constexpr size_t kClockSteps = 360;
  absl::StatusOr<std::vector<v1::ClockOffset>> clock_history(const std::string& name) const;

  std::vector<v1::Node> nodes() const;  // by kind, then name
  std::vector<v1::Node> up(v1::NodeKind kind) const;
  std::vector<RegisteredSolver> solvers() const;  // by name
  // The camera node of this name, or, without one, the only camera that is up. UNAVAILABLE: it is not up.
  // FAILED_PRECONDITION names the cameras if there are several.
  absl::StatusOr<v1::Node> camera(const std::string& name) const;
  // All displays; UNAVAILABLE if none is up.
  absl::StatusOr<std::vector<v1::Node>> displays() const;

 private:
  struct Entry {
    v1::Node node;
    v1::SolverInfo solver;
    nanoseconds heard{};
    nanoseconds clock_measured{};
    struct Measured {
      nanoseconds at, offset, bound;
    };
    std::deque<Measured> clock_history;  // at this address
  };
  absl::Status take(const v1::RegisterRequest& request, const std::optional<CertifiedPeer>& caller);
  // ALREADY_EXISTS: the node with this name is alive elsewhere. Releases `lock` while it asks that node.
  absl::Status check_free(const v1::RegisterRequest& request, std::unique_lock<std::mutex>& lock) const;
  void audit_refusal(const v1::RegisterRequest& request, const std::string& caller,
                     const absl::Status& refused);
  // Without forgotten nodes, with `up` as of now. Call with mutex_ held.
  std::vector<RegisteredSolver> current() const;

  const Now now_;
  const IsAlive is_alive_;
  std::chrono::milliseconds call_time_ = kNodeCall;
  mutable std::mutex mutex_;
  NodeNames names_;                             // guarded by mutex_, as the rest
  std::map<std::string, Entry> entries_;        // by name
  std::map<std::string, nanoseconds> audited_;  // refusals by their text, which is repeated each second
};

}  // namespace glasswing
