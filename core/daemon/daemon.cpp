#include "core/daemon/daemon.h"

#include <spdlog/spdlog.h>

#include <iostream>
#include <memory>

#include "core/base/status.h"
#include "core/base/version.h"
#include "core/cli/man_page.h"
#include "core/service/supervision.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kGrace(2);  // for running calls to end

absl::Status run_until_signal(const DaemonProgram& program, const CLI::App& app,
                              const DaemonOptions& options) {
  block_signals();
  start_logging(program.name, options.logs);
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<MetricsHost> metrics, MetricsHost::start(options.metrics));
  GW_RETURN_IF_ERROR(use_tls(options.tls));
  return program.run(app, options);
}

}  // namespace

int run_daemon(int argc, const char* const* argv, const DaemonProgram& program) {
  CLI::App app(program.description);
  set_up_help(app, program.name);
  app.footer(program.footer);
  DaemonOptions options{.metrics = {.address = "", .program = program.name, .build = program.build}};
  program.add_options(app, options);
  add_log_options(app, options.logs);
  add_metrics_option(app, options.metrics);
  app.set_version_flag("--version", kVersion);
  absl::StatusOr<int> exit_status = 0;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& answer) {  // --help and --version, too
    exit_status = app.exit(answer);
    options.command = [&exit_status] { return exit_status; };
  }
  if (options.command) {
    exit_status = options.command();
  } else if (const absl::Status status = run_until_signal(program, app, options); !status.ok()) {
    exit_status = status;
  }
  if (exit_status.ok() && !std::cout.flush())
    exit_status = absl::UnavailableError("the answer could not be written to standard output");
  if (exit_status.ok()) return *exit_status;
  std::cerr << program.name << ": " << exit_status.status().message() << "\n";
  return 1;
}

CLI::App& add_command(CLI::App& app, DaemonOptions& options, const std::string& name,
                      const std::string& description, std::function<absl::StatusOr<int>()> work) {
  CLI::App& command = *app.add_subcommand(name, description);
  command.preparse_callback([&app](size_t) {
    for (CLI::Option* option : app.get_options()) option->required(false);
  });
  command.callback([&options, work = std::move(work)] { options.command = work; });
  return command;
}

absl::Status serve(const DaemonOptions& options, const Served& served) {
  v1::RegisterRequest node = served.node;
  node.set_build(options.metrics.build);
  std::unique_ptr<ServiceHost> host;
  if (served.listens) {
    GW_ASSIGN_OR_RETURN(host, ServiceHost::start(options.listen, served.services, served.principal_of));
    node.set_address(host->advertised());
    spdlog::info("listening on address={}", host->address());
  }
  const Registration registration(served.server, node, served.data, served.update);
  const absl::Status begun = served.begin ? served.begin(host.get()) : absl::OkStatus();
  if (begun.ok()) serve_until_signal([&] { return host == nullptr || host->answers(kSelfCall); });
  if (served.end) served.end();
  if (host != nullptr) host->stop(begun.ok() ? kGrace : std::chrono::seconds(0));
  return begun;
}

}  // namespace glasswing
