// The monitors and the camera that the server's nodes have now.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

struct RigView {
  std::vector<v1::Monitor> monitors;            // of all displays that are up
  std::optional<v1::GetCameraResponse> camera;  // the first that is up
};

// UNAVAILABLE: the server or a node does not answer.
absl::StatusOr<RigView> look_at_rig(const Client& client);

}  // namespace glasswing
