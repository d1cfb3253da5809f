// A solver's work: tiles from the server, solved, and handed in, for as long as there are any.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <stop_token>
#include <string>

namespace glasswing {

struct WorkOptions {
  std::string server, name;
  int threads = 0;                          // that solve; 0: one for each core
  std::chrono::milliseconds until_idle{0};  // ends when there was nothing to do for so long; 0: never
};

// Until `stop` is asked for; a tile that is not solved by then is handed back. While one tile is solved the
// next one is read and the last one handed in. FAILED_PRECONDITION, if it is to end when idle: the server
// refuses this solver, and why.
absl::Status run_work_loop(const WorkOptions& options, std::stop_token stop);

}  // namespace glasswing
