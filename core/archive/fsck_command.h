// `fsck` on the command line: a subcommand of every daemon that stores data, and of `glasswing`.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <string>

#include "core/archive/check.h"
#include "core/archive/fsck.h"
#include "core/daemon/daemon.h"

namespace glasswing {

struct FsckArguments {
  std::string path;
  bool repair = false;
  bool json = false;
  // For `glasswing fsck`, which shows it: periodically prints "progress FRACTION" on standard error.
  bool show_progress = false;
};

inline constexpr int kDamage = 3;  // exit status: damage is left
inline constexpr char kFsckDescription[] = "Check stored data, and repair it.";
inline constexpr char kProgressLine[] = "progress ";  // a number in [0, 1] follows

// Declares PATH and --repair, and the help below them, with `examples`, one per line.
void add_fsck_arguments(CLI::App& command, FsckArguments& arguments, const std::string& examples);

// Root becomes the owner of the data: a daemon could not write to what root had written.
absl::Status become_owner(const std::string& path);

// Writes the report to standard output. Returns the exit status: 0 or kDamage.
int print_report(const CheckReport& report, const FsckArguments& arguments);

// Adds `fsck PATH [--repair] [--json]` to a daemon's program. `check_server` as in FsckOptions.
void add_fsck_command(CLI::App& app, DaemonOptions& options, const std::string& example,
                      decltype(FsckOptions::check_server) check_server = nullptr);

}  // namespace glasswing
