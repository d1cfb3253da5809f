// Points where tests kill or stop a daemon. GLASSWING_FAULT="tile written=kill" kills the process on its
// first visit to that point, "=stop" stops it until SIGCONT, "=kill@3" acts on the third visit. Without the
// variable nothing happens.
#pragma once

#include <string_view>

namespace glasswing {

void fault_point(std::string_view name);

}  // namespace glasswing
