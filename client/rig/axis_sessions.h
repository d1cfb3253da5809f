// Sessions of a series of poses, for the commands about the stage's axis.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// The named sessions, or with `series` those with this tag, sorted by name. NOT_FOUND: there is none.
absl::StatusOr<std::vector<v1::Session>> find_poses(const Client& client,
                                                    const std::vector<std::string>& names,
                                                    const std::string& series);

// The only axis of these sessions, or the named one, which all of them must have.
absl::StatusOr<std::string> axis_of(const std::vector<v1::Session>& sessions, const std::string& named);

}  // namespace glasswing
