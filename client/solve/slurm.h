// Solves a session with a Slurm job array: parts of rows, each `glasswing-solver solve --rows`, without any
// daemon. Slurm requeues lost ones.
#pragma once

#include <absl/status/status.h>

#include <map>
#include <string>
#include <vector>

#include "client/cli/client.h"

namespace glasswing {

struct SlurmSolve {
  std::string session, method;  // method empty: the plan's
  std::map<std::string, std::string> options;
  int parts = 16;
  std::string directory;  // on a disk of all machines, for parts and logs; empty: named after the session
  std::string archive;    // the session's, on such a disk; empty: exported into `directory`
  std::vector<std::string> sbatch;  // options for it
};

// Submits the parts missing in the directory, follows them, joins them, and hands the matte to the server.
// Shows progress. CANCELLED: Ctrl-C was pressed; the array continues, and the same command resumes it.
absl::Status solve_on_slurm(const Client& client, const SlurmSolve& solve);

}  // namespace glasswing
