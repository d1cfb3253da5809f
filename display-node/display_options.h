// The command line of glasswing-display.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/daemon/daemon.h"
#include "core/sim/panel.h"
#include "core/sim/panel_pose.h"
#include "display-node/backends/sim_display.h"
#include "display-node/services/emission_service.h"

namespace glasswing {

struct DisplayOptions {
  std::string server, name = "display-1";
  std::string backend = "sim";
  std::vector<std::string> monitors;
  std::string x11_server;
  double lag_ms = 3.0, settle_ms = 1.0;
  std::vector<std::string> patch_rows;
  std::optional<int> bits;  // of a code; empty: the backend's default
  // Of simulated screens.
  std::optional<double> true_lag_ms, true_settle_ms;
  std::string true_response = "linear", true_flicker;
  PanelModel panel;
  SimDisplay::Faults faults;
  double jitter_ms = 0.0, repeat = 0.0;
  double pitch_mm = 1.0;
  std::vector<std::string> tilts;
  // Of any.
  std::vector<std::string> rails;
  std::string rail_command;

  nanoseconds lag() const;
  nanoseconds settle() const;
  nanoseconds jitter() const;
  // INVALID_ARGUMENT: --patch-rows cannot be read.
  absl::StatusOr<PatchRows> patches() const;
  // INVALID_ARGUMENT: --true-response or --true-flicker cannot be read.
  absl::StatusOr<TrueOptics> true_optics() const;
};

void add_display_options(CLI::App& app, DaemonOptions& daemon, DisplayOptions& display);

}  // namespace glasswing
