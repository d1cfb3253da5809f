// How a node's machine is.
#pragma once

#include <filesystem>

#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// `data`: where the node keeps what it stores; empty: it stores nothing. `sensors`: where the kernel tells of
// them.
v1::NodeHealth node_health(const std::filesystem::path& data,
                           const std::filesystem::path& sensors = "/sys/class/hwmon");

}  // namespace glasswing
