// The monitors and the camera of the nodes that are up.
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/display_service.pb.h"

namespace glasswing {

struct RigView {
  std::vector<v1::Monitor> monitors;            // of every display node
  std::map<std::string, v1::Rail> rails;        // by monitor, of those on one
  std::optional<v1::GetCameraResponse> camera;  // of the named camera node, or of the first
};

// Asks the server, then every node. `camera`: a camera node's name; empty: any. UNAVAILABLE: a node does not
// answer.
absl::StatusOr<RigView> read_rig_view(const Client& client, const std::string& camera);

}  // namespace glasswing
