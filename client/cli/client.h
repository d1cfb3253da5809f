// The command line `glasswing`: it calls the server, transfers files, and composites.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "core/cli/command_line.h"

namespace glasswing {

// Shared by the verbs that need a rig.
struct Client : CommandLine {
  std::string server = "127.0.0.1:7440";

  std::string server_title() const { return "server at " + server; }
};

// The settings of calls: server, ca, certificate, key.
std::vector<Setting> call_settings();

// Declares the verbs (client/commands.h).
using AddCommands = std::function<void(CLI::App& app, Client& client, const Config& config)>;

// Parses the command line and runs it (run_command_line()).
int run_client(int argc, const char* const* argv, const AddCommands& add_commands);

}  // namespace glasswing
