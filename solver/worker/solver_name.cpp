#include "solver/worker/solver_name.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

#include "core/base/name.h"

namespace glasswing {
namespace {

constexpr size_t kMaxHost = 32;  // leaves as much for the job

std::string plain(const std::string& host) {
  std::string name;
  for (const char c : host.substr(0, kMaxHost)) name += check_name("", std::string{'x', c}).ok() ? c : '-';
  return check_name("", name).ok() ? name : fmt::format("solver{}", name);
}

}  // namespace

std::string solver_name(const std::string& host, int process,
                        const std::function<std::string(const char*)>& variable) {
  const std::string job = variable("SLURM_JOB_ID"), array = variable("SLURM_ARRAY_JOB_ID"),
                    tasks = variable("SLURM_NTASKS");
  if (job.empty()) return fmt::format("{}-{}", plain(host), process);
  std::string name = fmt::format("{}-job{}", plain(host), array.empty() ? job : array);
  if (!array.empty()) name += fmt::format("_{}", variable("SLURM_ARRAY_TASK_ID"));
  if (!tasks.empty() && tasks != "1") name += fmt::format(".{}", variable("SLURM_PROCID"));
  return name;
}

std::string solver_name() {
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  return solver_name(host.data(), ::getpid(), [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  });
}

}  // namespace glasswing
