#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>

#include "core/base/directory_lock.h"
#include "core/base/version.h"
#include "core/cli/daemon_options.h"
#include "core/cli/man_page.h"
#include "core/service/build_id.h"
#include "core/service/service.h"
#include "core/service/supervision.h"
#include "core/telemetry/logs.h"
#include "core/telemetry/metrics.h"
#include "core/telemetry/process_metrics.h"
#include "server/console/console.h"
#include "server/console/console_service.h"
#include "server/metrics/server_metrics.h"
#include "server/rig/clock_watch.h"
#include "server/services/fleet_service.h"
#include "server/services/rig_service.h"
#include "server/services/server.h"
#include "server/services/session_service.h"
#include "server/services/work_service.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  CLI::App app("Glasswing's server: rigs, sessions, the proof of each frame, and finished mattes.");
  set_up_help(app, "glasswing-server");
  app.footer("Example:\n  glasswing-server --listen 127.0.0.1:7440 --data /var/lib/glasswing");
  ServerOptions options;
  ListenOptions listen{.address = "127.0.0.1:7440", .reflection = false};
  LogOptions logs;
  add_listen_options(app, listen);
  app.add_option("--data", options.data, "directory for the catalogue and the mattes")->required();
  app.add_option("--jobs", options.jobs,
                 "PostgreSQL that holds the tiles of solves, as postgresql://user@host/glasswing; several "
                 "servers may share one. SQLite below --data if left out");
  ConsoleOptions at_console{.address = "", .files = default_console_files()};
  app.add_option("--console", at_console.address,
                 "host:port where browsers find the console, beyond this machine only with --certificate; "
                 "nowhere if left out");
  app.add_option("--console-files", at_console.files, "directory with the console's page")
      ->capture_default_str();
  double lease_seconds = 10.0;
  app.add_option("--lease", lease_seconds,
                 "seconds after which the tile of a silent solver is given to another")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_option("--least-tile", options.min_tile_seconds,
                 "seconds of work that the smallest tiles are cut to: less is lost where a solver dies, more "
                 "is handed out")
      ->check(CLI::Range(0.01, 2.0))
      ->capture_default_str();
  TlsFiles tls;
  add_tls_options(app, tls);
  add_log_options(app, logs);
  MetricsOptions metrics{.address = "", .program = "glasswing-server", .build = build_id()};
  add_metrics_option(app, metrics);
  app.set_version_flag("--version", kVersion);
  CLI11_PARSE(app, argc, argv);

  block_signals();
  start_logging("glasswing-server", logs);
  const auto fail = [](const absl::Status& status) {
    std::cerr << "glasswing-server: " << status.message() << "\n";
    return 1;
  };
  const absl::StatusOr<std::unique_ptr<MetricsHost>> metrics_host = MetricsHost::start(metrics);
  if (!metrics_host.ok()) return fail(metrics_host.status());
  if (absl::Status status = use_tls(tls); !status.ok()) return fail(status);
  options.address = listen.advertised.empty() ? listen.address : listen.advertised;
  options.lease = std::chrono::milliseconds(std::llround(1000.0 * lease_seconds));
  const absl::StatusOr<DirectoryLock> lock = DirectoryLock::take(options.data);
  if (!lock.ok()) return fail(lock.status());
  absl::StatusOr<std::unique_ptr<Server>> server = Server::open(options);
  if (!server.ok()) return fail(server.status());
  SessionServiceImpl sessions(**server);
  NodeServiceImpl nodes(**server);
  WorkServiceImpl work(**server);
  RigServiceImpl rig(**server);
  FleetServiceImpl fleet([&] { return (*server)->fleet(); });
  const absl::StatusOr<ConsoleKey> key = ConsoleKey::open(options.data);
  if (!key.ok()) return fail(key.status());
  ConsoleServiceImpl tokens(*key);
  server_metrics();
  const AskedMetrics asked([&] {
    const absl::StatusOr<std::vector<v1::Session>> sessions_now = (*server)->list({});
    return server_gauges((*server)->fleet(), sessions_now.ok() ? *sessions_now : std::vector<v1::Session>(),
                         (*server)->rig().nodes());
  });
  const AskedMetrics disk([&] { return disk_metrics(options.data); });
  absl::StatusOr<std::unique_ptr<ServiceHost>> host =
      ServiceHost::start(listen, {&sessions, &nodes, &work, &rig, &fleet, &tokens});
  if (!host.ok()) return fail(host.status());
  const ClockWatch clocks((*server)->rig());
  spdlog::info("listening on address={}", (*host)->address());
  std::unique_ptr<Console> console;
  if (!at_console.address.empty()) {
    at_console.name = options.address.substr(0, options.address.rfind(':'));
    auto started = Console::start(at_console, *key, (*host)->to_itself());
    if (!started.ok()) return fail(started.status());
    console = *std::move(started);
    tokens.serve_at(console->url());
    spdlog::info("console at url={}", console->url());
  }
  serve_until_signal([&] { return (*host)->answers(kSelfCall); });
  console.reset();
  sessions.stop();
  rig.stop();
  (*host)->stop(std::chrono::seconds(2));
  return 0;
}
