// Target positions of monitors, and moving them there.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>
#include <vector>

#include "client/cli/client.h"
#include "client/cli/rig_view.h"

namespace glasswing {

// "200,251.2", or "back:200,251.2" for one of several monitors.
struct RailPositions {
  std::string monitor;  // empty: not named
  std::vector<double> mm;
};
// INVALID_ARGUMENT: not of that form, or a repeated position; names `option`.
absl::StatusOr<RailPositions> parse_rail_positions(std::string_view option, const std::string& text);

// The monitor to use if none is named: the only one on a rail, or else the only one of `planned`, or else of
// the rig. FAILED_PRECONDITION: there are several. NOT_FOUND: the named one is not in the rig.
absl::StatusOr<std::string> monitor_to_move(const std::string& named, const RigView& rig,
                                            const std::vector<std::string>& planned = {});

// Returns when the monitor has arrived. Errors are the server's.
absl::Status move_along_rail(const Client& client, const std::string& monitor, double position_mm);

}  // namespace glasswing
