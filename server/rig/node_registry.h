// The nodes that have registered, and when each was last heard.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// A solver that is silent for so long is forgotten. Displays and cameras belong to the rig: they stay listed,
// as away.
inline constexpr nanoseconds kForgotten = std::chrono::minutes(10);

struct RegisteredSolver {
  v1::Node node;
  v1::SolverInfo info;
};

// Thread-safe.
class NodeRegistry {
 public:
  explicit NodeRegistry(std::function<nanoseconds()> now = monotonic_now) : now_(std::move(now)) {}

  absl::Status add(const v1::RegisterRequest& node);
  // Heard from a solver by its claims; `doing` is its activity as `glasswing nodes` shows it.
  void note(const std::string& name, const std::string& doing);

  // Measured now: the node's clock is ahead by `offset`, within `bound`.
  void note_clock(const std::string& name, nanoseconds offset, nanoseconds bound);

  std::vector<v1::Node> nodes() const;  // by kind, then name
  std::vector<v1::Node> up(v1::NodeKind kind) const;
  std::vector<RegisteredSolver> solvers() const;  // by name
  // The camera; UNAVAILABLE if none is up.
  absl::StatusOr<v1::Node> camera() const;
  // All displays; UNAVAILABLE if none is up.
  absl::StatusOr<std::vector<v1::Node>> displays() const;

 private:
  struct Entry {
    v1::Node node;
    v1::SolverInfo solver;
    nanoseconds heard{};
    nanoseconds clock_measured{};
  };
  // Without forgotten nodes, with `up` as of now. Call with mutex_ held.
  std::vector<RegisteredSolver> current() const;

  const std::function<nanoseconds()> now_;
  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;  // by name
};

}  // namespace glasswing
