// Another program, run to its end without a shell, with limits on its time and on the output kept.
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
// DEADLINE_EXCEEDED, CANCELLED: it had not ended within the limit, or when `stop` was requested; it and its
// process group were terminated, with SIGTERM and two seconds later with SIGKILL.
absl::StatusOr<ProgramEnd> run_program(const std::vector<std::string>& words, const RunOptions& options);

// The same for a program that should end with exit status 0. Also FAILED_PRECONDITION: it did not; the
// message has its last line of output.
absl::Status run_command(const std::vector<std::string>& words, const RunOptions& options);

// "move-stage /dev/ttyUSB0": separated by spaces.
std::vector<std::string> command_words(const std::string& command);

}  // namespace glasswing
