#include "solver/solver_daemon.h"

#include <unistd.h>

#include <cmath>
#include <csignal>
#include <thread>

#include "core/archive/archive_metrics.h"
#include "core/archive/archive_service.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "solver/live/live_service.h"
#include "solver/worker/solver_metrics.h"
#include "solver/worker/solver_name.h"
#include "solver/worker/vector_target.h"
#include "solver/worker/work_loop.h"

namespace glasswing {
namespace {

v1::RegisterRequest node_of(const std::string& name, int threads) {
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_SOLVER);
  node.set_name(name);
  char hostname[256] = "";
  ::gethostname(hostname, sizeof(hostname) - 1);
  node.mutable_solver()->set_host(hostname);
  node.mutable_solver()->set_threads(threads > 0 ? threads
                                                 : static_cast<int>(std::thread::hardware_concurrency()));
  node.mutable_solver()->set_vectors(vector_target());
  return node;
}

}  // namespace

absl::Status run_solver(const DaemonOptions& daemon, const SolverOptions& options) {
  const std::string name = options.name.empty() ? solver_name() : options.name;
  GW_RETURN_IF_ERROR(check_name("node", name));
  const bool listens = !daemon.listen.address.empty();
  LiveServiceImpl live(0);  // on all cores, because somebody is watching
  ArchiveStore archives(options.archives);
  ArchiveServiceImpl archive_service(archives);
  std::vector<grpc::Service*> services = {&live};
  if (!options.archives.empty()) {
    if (!listens) return absl::InvalidArgumentError("--archives needs --listen: others read from it");
    GW_RETURN_IF_ERROR(archives.prepare());
    services.push_back(&archive_service);
  }
  solver_metrics();
  archive_metrics();
  const WorkOptions work{
      .server = options.server,
      .name = name,
      .threads = options.threads,
      .until_idle = std::chrono::milliseconds(std::llround(1000.0 * options.until_idle_seconds))};
  absl::Status worked;
  std::jthread worker;
  const auto begin = [&](ServiceHost*) {
    worker = std::jthread([&](std::stop_token stop) {
      worked = run_work_loop(work, stop);
      ::kill(::getpid(), SIGTERM);  // ends serve()
    });
    return absl::OkStatus();
  };
  const auto end = [&] {
    worker = std::jthread();  // stops and joins it
    live.stop();
    archive_service.stop();
  };
  GW_RETURN_IF_ERROR(serve(daemon, {.services = services,
                                    .listens = listens,
                                    .node = node_of(name, options.threads),
                                    .server = options.server,
                                    .begin = begin,
                                    .end = end}));
  return worked;
}

}  // namespace glasswing
