// What a solver is called if nobody names it, so that a fleet needs no names.
#pragma once

#include <functional>
#include <string>

namespace glasswing {

// The host's name and what tells this solver from the others there: Slurm's job, "lab3-job117_4" (with a
// task, "lab3-job117.2", where a job has several), else the process, "lab3-4711". A name as check_name()
// wants it: the host's is cut and changed for that. `variable` is the environment's value of a name, empty if
// there is none.
std::string solver_name(const std::string& host, int process,
                        const std::function<std::string(const char*)>& variable);

// Of this process.
std::string solver_name();

}  // namespace glasswing
