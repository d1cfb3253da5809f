// Another program, run to its end without a shell, within limits of time and of what is kept of its output.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

struct RunOptions {
  std::chrono::milliseconds limit{60'000};
  std::stop_token stop = {};
  std::string_view input = {};  // its standard input; empty: /dev/null
  bool keep_output = false;     // else it writes to `output_file`
  int output_file = -1;         // an open file; -1: this process's standard output
};

struct ProgramEnd {
  int status = 0;      // as a shell says it: 128 + the number of the signal that ended it
  std::string output;  // the first MiB of its standard output, if kept
  std::string error;   // the last line of its standard error
};

// The words are the program, looked up in PATH, and its arguments. FAILED_PRECONDITION: it cannot be run.
// DEADLINE_EXCEEDED, CANCELLED: it had not ended within the limit, or when `stop` was requested; it and what
// it started in its process group were ended, by SIGTERM and two seconds later by SIGKILL.
absl::StatusOr<ProgramEnd> run_program(const std::vector<std::string>& words, const RunOptions& options);

// The same for a program that should end with exit status 0. FAILED_PRECONDITION, too: it did not; has the
// last line of what it said.
absl::Status run_command(const std::vector<std::string>& words, const RunOptions& options);

// "move-stage /dev/ttyUSB0": divided by spaces.
std::vector<std::string> command_words(const std::string& command);

}  // namespace glasswing
