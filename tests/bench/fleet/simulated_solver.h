// A solver whose work is a timed wait. Everything else is real: its own connection, leases that it keeps, and
// for every tile a matte of its rows, which it sends.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/time.h"

namespace glasswing {

struct SimulatedWork {
  std::string server, session;
  int width_px = 0, height_px = 0;  // of the camera's picture
  std::uint64_t seed = 1;
  // Of a tile: the least and, on average, what comes on top, exponentially distributed; never more than the
  // most.
  double min_s = 0.5, more_s = 1.0, max_s = 5.0;
  double row_s = 2.0;  // what a survey says of every row: so much that each becomes a tile
};

// A tile's wait, the same for whoever gets it.
double wait_s(const SimulatedWork& work, int first_row);

struct SolvedTile {
  int tile = 0;
  nanoseconds asked{};     // for work
  nanoseconds claimed{};   // it was there
  nanoseconds solved{};    // the wait was over
  nanoseconds answered{};  // the server has it, or says that another was quicker
  bool counts = false;     // it was not another
};

struct SolverLog {
  std::vector<SolvedTile> tiles;
  std::vector<std::string> errors;
};

// Works until it is asked to stop.
SolverLog run_simulated_solver(const SimulatedWork& work, const std::string& name, std::stop_token stop);

}  // namespace glasswing
