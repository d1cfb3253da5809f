// The state of a node's machine.
#pragma once

#include <filesystem>

#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// Free space on the disk of `data` (empty: the node stores nothing), and the highest temperature of
// `sensors`, the directory in which the kernel lists them.
v1::NodeHealth node_health(const std::filesystem::path& data,
                           const std::filesystem::path& sensors = "/sys/class/hwmon");

}  // namespace glasswing
