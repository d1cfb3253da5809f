// Programs that a daemon runs, by no shell.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <vector>

namespace glasswing {

// "move-stage /dev/ttyUSB0": divided by spaces.
std::vector<std::string> command_words(const std::string& command);

// Open files that it gets in place of /dev/null and this program's own output; -1: not so.
struct CommandFiles {
  int input = -1, output = -1;
};

// Runs words[0] with the others as its arguments until it ends, which it should with exit status 0.
// FAILED_PRECONDITION: it cannot be run, or failed: has the last line of what it said. DEADLINE_EXCEEDED: it
// ran longer than `limit`. CANCELLED: stopped. Then it gets SIGTERM, and two seconds later it and what it
// started are killed.
absl::Status run_command(const std::vector<std::string>& words, std::chrono::milliseconds limit,
                         std::stop_token stop, CommandFiles files = {});

}  // namespace glasswing
