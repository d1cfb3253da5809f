// main() of the daemons: all of them parse, log, listen, register and stop in the same way, and differ in
// their options, their devices and their services.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/security/tls.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "core/telemetry/logs.h"
#include "core/telemetry/metrics.h"
#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// The parsed options that daemons share. `command` is set by the subcommand that was chosen, if any.
struct DaemonOptions {
  ListenOptions listen = {};
  TlsFiles tls = {};
  LogOptions logs = {};
  MetricsOptions metrics = {};
  std::function<absl::StatusOr<int>()> command = nullptr;  // returns the exit status
};

struct DaemonProgram {
  std::string name;         // "glasswing-camera"
  std::string description;  // of --help
  std::string footer;
  std::string build;  // build_id(), which only programs are linked with
  // Declares the program's own options, including those for listening and TLS, and its subcommands.
  std::function<void(CLI::App& app, DaemonOptions& options)> add_options;
  // The daemon itself: opens its devices, and serve()s until it is to end.
  std::function<absl::Status(const CLI::App& app, const DaemonOptions& options)> run;
};

// Parses the command line and runs the subcommand that was chosen, or the daemon: with SIGINT and SIGTERM
// blocked, and its log, metrics and TLS started. A failure is one line "NAME: message" on standard error.
// Returns the exit status: 0 on success, 1 on failure, CLI11's on a wrong command line.
int run_daemon(int argc, const char* const* argv, const DaemonProgram& program);

// Declares a subcommand that serves nothing. It does not need the daemon's required options.
CLI::App& add_command(CLI::App& app, DaemonOptions& options, const std::string& name,
                      const std::string& description, std::function<absl::StatusOr<int>()> work);

// What a daemon serves from its first call to its last.
struct Served {
  std::vector<grpc::Service*> services;
  PrincipalOf principal_of = nullptr;  // for calls that the console makes for people
  bool listens = true;
  // How the node registers with `server` (host:port; empty: nowhere); serve() adds its build and address.
  v1::RegisterRequest node = {};
  std::string server = {};
  std::filesystem::path data = {};  // whose disk the node reports on; empty: it stores nothing
  Registration::Update update = nullptr;
  // Called once the services answer, with null if the daemon does not listen. An error ends the daemon.
  std::function<absl::Status(ServiceHost* host)> begin = nullptr;
  // Ends what `begin` began and the running calls, so that the services can stop.
  std::function<void()> end = nullptr;
};

// Listens, registers, and returns after SIGINT or SIGTERM, when all services have stopped.
absl::Status serve(const DaemonOptions& options, const Served& served);

}  // namespace glasswing
