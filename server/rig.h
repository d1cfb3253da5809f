// The nodes that have registered, and for how long they have been silent.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// Thread-safe.
class Rig {
 public:
  absl::Status add(const v1::RegisterRequest& node);
  // A solver is also known by its claims; `doing` is what `nodes` shows.
  void note(const std::string& name, const std::string& doing);

  std::vector<v1::Node> nodes() const;  // by kind, then name
  std::vector<v1::Node> up(v1::NodeKind kind) const;
  // The camera; UNAVAILABLE if none is up.
  absl::StatusOr<v1::Node> camera() const;
  // All displays; UNAVAILABLE if none is up.
  absl::StatusOr<std::vector<v1::Node>> displays() const;

 private:
  struct Entry {
    v1::Node node;
    nanoseconds heard{};
  };
  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;  // by name
};

}  // namespace glasswing
