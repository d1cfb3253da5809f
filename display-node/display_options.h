// The command line of glasswing-display.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/daemon/daemon.h"
#include "core/daemon/daemon_options.h"
#include "core/sim/panel.h"
#include "core/sim/panel_pose.h"
#include "display-node/display_backend.h"
#include "display-node/services/emission_service.h"

namespace glasswing {

struct DisplayOptions {
  std::string server, name = "display-1";
  std::string backend = "sim";
  std::vector<std::string> monitors;
  double lag_ms = 3.0, settle_ms = 1.0;
  std::vector<std::string> patch_rows;
  std::optional<int> bits;  // of a code; empty: the backend's default
  // Of simulated screens.
  std::optional<double> true_lag_ms, true_settle_ms;
  std::string true_response = "linear", true_flicker;
  PanelModel panel;
  double repeat = 0.0;
  std::uint64_t fault_seed = 1;
  double pitch_mm = 1.0;
  std::vector<std::string> tilts;
  // Of any.
  std::vector<std::string> rails;
  std::string rail_command, line;

  // Opens the screens that --backend and --monitor name. INVALID_ARGUMENT: `app` has an option that this
  // backend does not take, or one with a bad value; else the backend's own errors.
  absl::StatusOr<std::unique_ptr<Display>> open(const CLI::App& app) const;
  // INVALID_ARGUMENT: --patch-rows cannot be parsed.
  absl::StatusOr<PatchRows> patches() const;
  // INVALID_ARGUMENT: --true-response or --true-flicker cannot be parsed.
  absl::StatusOr<TrueOptics> true_optics() const;

  std::vector<DisplayBackend> backends;  // all there are
  BackendOptions backend_options;
};

void add_display_options(CLI::App& app, DaemonOptions& daemon, DisplayOptions& display);

}  // namespace glasswing
