// Points where tests kill or stop a daemon. GLASSWING_FAULT="tile written=kill" kills the process on its
// first visit to that point, "=stop" stops it until SIGCONT, "=kill@3" acts on the third visit. Without the
// variable nothing happens.
#pragma once

#include <functional>
#include <string_view>

namespace glasswing {

void fault_point(std::string_view name);

// For tests within one process: calls `act` with the name of each point, on the thread that visits it, until
// it is replaced. Null: nothing is called any more; a running call continues.
void at_fault_points(std::function<void(std::string_view)> act);

}  // namespace glasswing
