// Pictures that the server keeps: photos of plans, and backgrounds of composites.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

#include "client/cli/client.h"
#include "client/cli/rpc.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {

// Uploads the plan's photos, scaled to its first monitor, and replaces their file names by the names of the
// uploads. UNAVAILABLE: no display node is up.
absl::Status upload_photos(const Client& client, const Peer<v1::SessionService>& server,
                           const std::filesystem::path& plan_path, v1::Plan& plan);

// Uploads a picture in its own size, and returns the upload's name. INVALID_ARGUMENT: it is brighter than
// white.
absl::StatusOr<std::string> upload_background(const Peer<v1::SessionService>& server,
                                              const std::filesystem::path& file);

}  // namespace glasswing
