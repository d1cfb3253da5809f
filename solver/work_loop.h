// Asks the server for tiles, reads their frames from the node that holds them, solves, and hands the result
// in.
#pragma once

#include <stop_token>
#include <string>

namespace glasswing {

// Runs until stopped; a tile in hand is given up then. `thread_count` 0: one for each core. A server that
// does not answer is tried again for ever; a result is kept until the server says that it is durable, or that
// the lease went to somebody else.
void run_work_loop(const std::string& server_address, const std::string& solver_name, int thread_count,
                   std::stop_token stop);

}  // namespace glasswing
