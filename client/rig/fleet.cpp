#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <iostream>
#include <mutex>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "glasswing/v1/fleet_service.grpc.pb.h"

namespace glasswing {
namespace {

using FleetPeer = Peer<v1::FleetService>;

const char* state_of(const v1::FleetSolver& solver) {
  if (!solver.up()) return "away";
  return solver.refused().empty() ? "up" : "refused";
}

const char* state_of(const v1::FleetSolve& solve) {
  if (solve.held()) return "held";
  return solve.tile_count() == 0 ? "surveying" : "solving";
}

// "late by 4 min"
std::string due_text(const v1::FleetSolve& solve) {
  if (solve.deadline().empty()) return "-";
  if (!solve.has_late_s()) return "at " + solve.deadline();
  return solve.late_s() > 0.0 ? "late by " + left_text(solve.late_s()) : "in time";
}

std::string rate_text(double per_second) {
  return per_second > 0.0 ? fmt::format("{:.2f}", per_second) : "-";
}

// "vase tile 3, vase tile 4 (twice)"
std::string doing_text(const v1::FleetSolver& solver) {
  std::vector<std::string> doing;
  for (const v1::FleetLease& lease : solver.leases())
    doing.push_back(
        fmt::format("{} tile {}{}", lease.session(), lease.tile(), lease.twice() ? " (twice)" : ""));
  if (doing.empty()) return solver.up() && solver.refused().empty() ? "waiting for work" : "-";
  return fmt::format("{}", fmt::join(doing, ", "));
}

// The age of the oldest lease.
std::string busy_text(const v1::FleetSolver& solver) {
  double longest = 0.0;
  for (const v1::FleetLease& lease : solver.leases()) longest = std::max(longest, lease.seconds());
  return solver.leases().empty() ? "-" : seconds_text(longest);
}

void print_solvers(const Client& client, const v1::GetFleetResponse& fleet) {
  std::vector<std::vector<std::string>> rows;
  for (const v1::FleetSolver& solver : fleet.solvers()) {
    rows.push_back({solver.name(), solver.host().empty() ? "-" : solver.host(), state_of(solver),
                    doing_text(solver), busy_text(solver), rate_text(solver.tiles_per_second()),
                    std::to_string(solver.tiles_done()), std::to_string(solver.tiles_failed()),
                    solver.refused().empty() ? solver.last_error() : solver.refused()});
  }
  print_table(client,
              {{"SOLVER"},
               {"HOST"},
               {"STATE"},
               {"DOING"},
               {"FOR", true},
               {"TILES/S", true},
               {"DONE", true},
               {"FAILED", true},
               {"PROBLEM"}},
              rows);
}

void print_solves(const Client& client, const v1::GetFleetResponse& fleet) {
  std::vector<std::vector<std::string>> rows;
  for (const v1::FleetSolve& solve : fleet.solves()) {
    rows.push_back({solve.session(), state_of(solve), solve.method(), solve.priority(), solve.owner(),
                    fmt::format("{}/{}", solve.tiles_done(), solve.tile_count()),
                    std::to_string(solve.tiles_leased()), rate_text(solve.tiles_per_second()),
                    solve.seconds_left() > 0.0 ? left_text(solve.seconds_left()) : "-", due_text(solve),
                    std::to_string(solve.failures()), std::to_string(solve.quarantined()),
                    solve.server().empty() ? "this one" : solve.server()});
  }
  print_table(client,
              {{"SESSION"},
               {"STATE"},
               {"METHOD"},
               {"PRIORITY"},
               {"OWNER"},
               {"TILES", true},
               {"LEASED", true},
               {"TILES/S", true},
               {"LEFT", true},
               {"DUE"},
               {"FAILURES", true},
               {"QUARANTINED", true},
               {"SERVER"}},
              rows);
}

std::string summary_of(const v1::GetFleetResponse& fleet) {
  const auto up = std::ranges::count_if(fleet.solvers(), &v1::FleetSolver::up);
  double rate = 0.0;
  for (const v1::FleetSolver& solver : fleet.solvers()) rate += solver.tiles_per_second();
  return fmt::format("{} of {} solvers up, {:.2f} tiles/s; jobs are in {}", up, fleet.solvers_size(), rate,
                     fleet.store());
}

void print_fleet(const Client& client, const v1::GetFleetResponse& fleet) {
  if (client.json) return print_json(fleet);
  if (!client.tsv) std::cout << summary_of(fleet) << "\n\n";
  if (client.tsv || !fleet.solvers().empty()) {
    print_solvers(client, fleet);
  } else {
    std::cout << "no solvers; start some with: glasswing-solver --server " << client.server
              << " --name NAME\n";
  }
  std::cout << "\n";
  if (client.tsv || !fleet.solves().empty()) {
    print_solves(client, fleet);
  } else {
    std::cout << "no work; start some with: glasswing solve SESSION\n";
  }
}

absl::StatusOr<v1::GetFleetResponse> ask(const FleetPeer& server) {
  return call_pages(server, &v1::FleetService::Stub::GetFleet, {});
}

// Runs until Ctrl-C; keeps trying if the server does not answer.
absl::Status watch_fleet(const Client& client, const FleetPeer& server) {
  if (client.json || client.tsv || ::isatty(STDOUT_FILENO) != 1) {
    return absl::InvalidArgumentError(
        "--watch draws on a terminal; it cannot be used with --json, with --tsv or when output is "
        "redirected");
  }
  std::mutex mutex;
  std::condition_variable wake;
  bool enough = false;  // guarded by mutex
  const Interruptible ctrl_c([&] {
    const std::lock_guard lock(mutex);
    enough = true;
    wake.notify_all();
  });
  std::unique_lock lock(mutex);
  while (!enough) {
    lock.unlock();
    const absl::StatusOr<v1::GetFleetResponse> fleet = ask(server);
    std::cout << "\x1b[H\x1b[J";  // moves to the upper left corner and clears the screen
    if (fleet.ok()) {
      print_fleet(client, *fleet);
    } else {
      std::cout << printable(std::string(fleet.status().message())) << "; retrying\n";
    }
    std::cout << std::flush;
    lock.lock();
    wake.wait_for(lock, std::chrono::seconds(1), [&] { return enough; });
  }
  return absl::OkStatus();
}

absl::Status show_fleet(const Client& client, bool watch) {
  const FleetPeer server(client.server_title(), client.server);
  if (watch) return watch_fleet(client, server);
  GW_ASSIGN_OR_RETURN(const v1::GetFleetResponse fleet, ask(server));
  print_fleet(client, fleet);
  return absl::OkStatus();
}

}  // namespace

void add_fleet_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("fleet", "List the solvers, their work and speed, and what remains to be solved.");
  command.footer(
      "Rates cover the last minute. --tsv prints both lists, separated by an empty line.\n\n"
      "Examples:\n"
      "  glasswing fleet\n"
      "  glasswing fleet --watch");
  auto watch = std::make_shared<bool>(false);
  command.add_flag("--watch", *watch, "refresh every second until Ctrl-C");
  command.callback(
      [&client, watch] { client.run = [&client, watch] { return show_fleet(client, *watch); }; });
}

}  // namespace glasswing
