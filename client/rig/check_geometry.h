// Checks whether a rig is still where it was calibrated.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/rig_service.pb.h"

namespace glasswing {

// Compares the poses in a geometry file with the places seen by pixels beside the object of a solved session;
// one finding per monitor. `session`: a name, or a matte file; empty: the newest solved one. A monitor's pose
// is the one with the session's name, or else with its rail position, or else the best-fitting one.
// NOT_FOUND: no such session, or no solved one. INVALID_ARGUMENT: the file is invalid, or for another camera.
absl::StatusOr<std::vector<v1::Finding>> check_rig_geometry(const Client& client, const std::string& file,
                                                            const std::string& session);

}  // namespace glasswing
