// Where tests make a daemon die, hang or stumble: GLASSWING_FAULT="tile written=kill" kills the process the
// first time that it comes by, "=stop" stops it until somebody sends SIGCONT, "=kill@3" does so the third
// time. Without the variable nothing happens.
#pragma once

#include <string_view>

namespace glasswing {

void fault_point(std::string_view name);

}  // namespace glasswing
