// Devices that a program moves, once for each move: "turn-table /dev/ttyUSB0 {position}". It succeeds (exit
// status 0) when the device stands there.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace glasswing {

// INVALID_ARGUMENT: `command`, the value of `option`, is empty or has no `place`, such as "{mm}". `example`:
// a program and its arguments.
absl::Status check_move_command(std::string_view option, std::string_view command, std::string_view place,
                                std::string_view example);

// Runs the words (command_words) with `values` in them, {place, value} each. FAILED_PRECONDITION: the program
// cannot be run, failed (has its last line of output), or has not moved `what` within `limit`. CANCELLED:
// `stop`. In both cases it gets SIGTERM, and is killed two seconds later.
absl::Status run_move_command(std::vector<std::string> words,
                              const std::vector<std::pair<std::string, std::string>>& values,
                              std::string_view what, std::chrono::milliseconds limit, std::stop_token stop);

}  // namespace glasswing
