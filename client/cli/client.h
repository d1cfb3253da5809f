// The command line `glasswing`: it calls the server, transfers files, and composites.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace glasswing {

// Shared by all subcommands. Parsing stores the chosen subcommand's work in `run`.
struct Client {
  std::string server = "127.0.0.1:7440";
  bool json = false;
  bool tsv = false;       // lists only
  bool coloured = false;  // standard output
  std::function<absl::Status()> run;
  int exit_status = 0;  // on success; `hold` passes on its command's

  std::string server_title() const { return "server at " + server; }
};

// Exit statuses; 0 means success.
inline constexpr int kFailure = 1, kUsageError = 2, kInterrupted = 130;

// Declares the verbs (client/commands.h).
class Config;
using AddCommands = std::function<void(CLI::App& app, Client& client, const Config& config)>;

// Parses the command line and runs it. Every failure, including wrong usage, is one line on standard error.
int run_client(int argc, const char* const* argv, const AddCommands& add_commands);

}  // namespace glasswing
