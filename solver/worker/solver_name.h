// The default name of a solver, so that a fleet needs no configuration.
#pragma once

#include <functional>
#include <string>

namespace glasswing {

// The host's name and what distinguishes this solver on it: Slurm's job, "lab3-job117_4" (or with the task,
// "lab3-job117.2", if the job has several), or without Slurm the process, "lab3-4711". The host's name is
// shortened and changed to satisfy check_name(). `variable` returns an environment variable, empty if it is
// unset.
std::string solver_name(const std::string& host, int process,
                        const std::function<std::string(const char*)>& variable);

// For this process.
std::string solver_name();

}  // namespace glasswing
