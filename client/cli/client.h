// The command line `glasswing`: a thin client that asks the server, moves files, and composites.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace glasswing {

// What every subcommand sees. Parsing leaves the chosen subcommand's work in `run`.
struct Client {
  std::string server = "127.0.0.1:7440";
  bool json = false;
  bool tsv = false;       // lists only
  bool coloured = false;  // what goes to standard output
  std::function<absl::Status()> run;
  int exit_status = 0;  // on success: of a command that was run

  std::string server_title() const { return "server at " + server; }
};

// The exit status: 0 only on success.
inline constexpr int kFailure = 1, kUsageError = 2, kInterrupted = 130;

// Declares the verbs (client/commands.h).
class Config;
using AddCommands = std::function<void(CLI::App& app, Client& client, const Config& config)>;

// Parses and runs. Every failure, of usage too, is one line on standard error.
int run_client(int argc, const char* const* argv, const AddCommands& add_commands);

}  // namespace glasswing
