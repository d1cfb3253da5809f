// `glasswing fsck --rig`: compares the server's catalogue with the nodes' archives, and asks the server
// whether each matte is intact. Frames are not read: the nodes' own fsck does that.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <vector>

#include "client/cli/client.h"
#include "core/archive/check.h"

namespace glasswing {

struct RigReport {
  CheckReport found;                    // file_count: archives and mattes that were compared
  std::vector<std::string> unanswered;  // nodes, and why; what they hold was not compared
};

// `tell`: progress in [0, 1].
absl::StatusOr<RigReport> compare_rig(const Client& client, const std::function<void(double fraction)>& tell);

}  // namespace glasswing
