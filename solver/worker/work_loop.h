// A solver's main loop: claims tiles from the server, solves them and delivers the results.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <stop_token>
#include <string>

namespace glasswing {

struct WorkOptions {
  std::string server, name;
  int threads = 0;                               // for solving; 0: one for each core
  std::chrono::milliseconds until_idle{0};       // end after so long without work; 0: never
  std::chrono::milliseconds claim_time{5000};    // until a claim is made again, more than its wait of 2 s
  std::chrono::milliseconds result_time{60000};  // until a result is sent again
};

// Runs until `stop` is requested and then returns an unsolved tile to the server. While one tile is solved,
// the next is read and the previous one delivered. FAILED_PRECONDITION if `until_idle` is set and the server
// refuses this solver; the message says why.
absl::Status run_work_loop(const WorkOptions& options, std::stop_token stop);

}  // namespace glasswing
