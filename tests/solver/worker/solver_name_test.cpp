#include "solver/worker/solver_name.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "core/base/name.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using Variables = std::map<std::string, std::string>;

std::string named(const std::string& host, const Variables& variables = {}) {
  return solver_name(host, 4711, [&](const char* name) -> std::string {
    const auto found = variables.find(name);
    return found == variables.end() ? "" : found->second;
  });
}

TEST(SolverName, TellsSolversOfAHostApart) {
  EXPECT_EQ(named("lab3"), "lab3-4711");
  EXPECT_EQ(named("lab3", {{"SLURM_JOB_ID", "118"}, {"SLURM_NTASKS", "1"}}), "lab3-job118");
  // In an array each task has its own job id, but is named by the array's.
  const Variables array{{"SLURM_JOB_ID", "118"}, {"SLURM_ARRAY_JOB_ID", "117"}, {"SLURM_ARRAY_TASK_ID", "4"}};
  EXPECT_EQ(named("lab3", array), "lab3-job117_4");
  EXPECT_EQ(named("lab3", {{"SLURM_JOB_ID", "118"}, {"SLURM_NTASKS", "3"}, {"SLURM_PROCID", "2"}}),
            "lab3-job118.2");
}

TEST(SolverName, IsOneThatTheServerTakes) {
  const Variables longest{{"SLURM_JOB_ID", "67108863"},
                          {"SLURM_ARRAY_JOB_ID", "67108862"},
                          {"SLURM_ARRAY_TASK_ID", "4000000"},
                          {"SLURM_NTASKS", "10000"},
                          {"SLURM_PROCID", "9999"}};
  const std::vector<std::string> hosts{"lab3.example.org", std::string(255, 'h'), "Rechner_ä", "-odd", ""};
  for (const std::string& host : hosts) {
    for (const Variables& variables : {Variables(), longest}) {
      const std::string name = named(host, variables);
      EXPECT_OK(check_name("node", name)) << name;
    }
  }
  EXPECT_OK(check_name("node", solver_name())) << solver_name();
}

}  // namespace
}  // namespace glasswing
