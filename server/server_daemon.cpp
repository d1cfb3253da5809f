#include "server/server_daemon.h"

#include <cmath>
#include <memory>
#include <optional>

#include "core/base/status.h"
#include "core/file/directory_lock.h"
#include "core/telemetry/process_metrics.h"
#include "server/console/console_service.h"
#include "server/events/event_watch.h"
#include "server/metrics/server_metrics.h"
#include "server/rig/clock_watch.h"
#include "server/services/fleet_service.h"
#include "server/services/job_service.h"
#include "server/services/matte_service.h"
#include "server/services/queue_service.h"
#include "server/services/rig_service.h"
#include "server/services/server.h"
#include "server/services/session_service.h"
#include "server/services/storage_service.h"
#include "server/services/work_service.h"

namespace glasswing {

absl::Status run_server(const DaemonOptions& daemon, ServerProgramOptions options) {
  options.store.address = daemon.listen.advertised.empty() ? daemon.listen.address : daemon.listen.advertised;
  options.store.lease = std::chrono::milliseconds(std::llround(1000.0 * options.lease_seconds));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Hook> hook, Hook::create(options.hook));
  GW_ASSIGN_OR_RETURN(const DirectoryLock lock, DirectoryLock::take(options.store.data));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Server> server, Server::open(options.store));
  SessionServiceImpl sessions(*server);
  NodeServiceImpl nodes(*server);
  WorkServiceImpl work(*server);
  RigServiceImpl rig(*server);
  MatteServiceImpl mattes(*server);
  QueueServiceImpl queue(*server);
  JobServiceImpl jobs(*server);
  StorageServiceImpl storage(server->storage());
  FleetServiceImpl fleet([&] { return server->fleet(); });
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<AccessTokens> tokens,
                      AccessTokens::open(options.store.data, server->problems()));
  ConsoleServiceImpl console(*tokens);
  server_metrics();
  const AskedMetrics asked([&] {
    const absl::StatusOr<std::vector<v1::Session>> now = server->list({});
    return server_gauges(server->fleet(), now.ok() ? *now : std::vector<v1::Session>(), server->rig().nodes(),
                         server->problems().all().size());
  });
  const AskedMetrics disk([&] { return disk_metrics(options.store.data); });
  std::optional<ClockWatch> clocks;
  const EventWatch events(server->sessions(), options.store.data, *hook);
  server->queue().observe([&hook](const Event& event) { hook->add(event); });
  return serve(daemon, {.services = {&sessions, &nodes, &work, &rig, &fleet, &mattes, &queue, &jobs, &storage,
                                     &console},
                        .principal_of =
                            [&](const std::string& login) {
                              return tokens->principal_of(login, AccessTokens::current_time());
                            },
                        .begin = [&](ServiceHost*) -> absl::Status {
                          clocks.emplace(server->rig());
                          return absl::OkStatus();
                        },
                        .end =
                            [&] {
                              sessions.stop();
                              rig.stop();
                            }});
}

}  // namespace glasswing
