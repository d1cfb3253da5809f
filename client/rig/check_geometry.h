// Whether a rig still stands as it was calibrated.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/rig_service.pb.h"

namespace glasswing {

// Compares the poses of a geometry's file with where the pixels of a solved session look beside its object, a
// finding for each monitor. `session`: a name, or a matte's file; empty: the newest that is solved. A
// monitor's pose is that of the session's name, else of its position on its rail, else the one that suits
// best. NOT_FOUND: there is no such session, or no solved one. INVALID_ARGUMENT: the file, or it is of
// another camera.
absl::StatusOr<std::vector<v1::Finding>> check_rig_geometry(const Client& client, const std::string& file,
                                                            const std::string& session);

}  // namespace glasswing
