// The command line of a program with verbs: parsing, settings, errors.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "core/cli/config.h"

namespace glasswing {

// Shared by all verbs. Parsing stores the chosen verb's work in `run`.
struct CommandLine {
  bool json = false;
  bool tsv = false;       // lists only
  bool coloured = false;  // standard output
  std::function<absl::Status()> run;
  int exit_status = 0;  // on success
};

// Exit statuses; 0 means success.
inline constexpr int kFailure = 1, kUsageError = 2, kInterrupted = 130;

struct Program {
  std::string name, description, footer;  // of --help
  std::vector<Setting> settings;          // beside "color"
  // Declares the verbs.
  std::function<void(CLI::App& app, const Config& config)> add_commands;
  // Called between parsing and the verb's work; its failure counts as wrong usage. May be empty.
  std::function<absl::Status(const Config& config)> configure = {};
};

// Parses the command line and runs it. Every failure, including wrong usage, is one line on standard error.
// Returns the exit status.
int run_command_line(int argc, const char* const* argv, const Program& program, CommandLine& command_line);

}  // namespace glasswing
