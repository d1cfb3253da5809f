// Checks whether a rig is still where it was calibrated.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/rig_service.pb.h"

namespace glasswing {

// Compares the poses in geometry files, one or CAMERA=FILE for each of several cameras, with the places seen
// by pixels beside the object of a solved session; one finding per file and monitor. `session`: a name, or a
// matte file; empty: the newest solved one, of each camera. A monitor's pose is the one with the session's
// name, or else with its rail position, or else the best-fitting one. NOT_FOUND: no such session, or no
// solved one. INVALID_ARGUMENT: a file is invalid, or for another camera.
absl::StatusOr<std::vector<v1::Finding>> check_rig_geometry(const Client& client,
                                                            const std::vector<std::string>& files,
                                                            const std::string& session);

}  // namespace glasswing
