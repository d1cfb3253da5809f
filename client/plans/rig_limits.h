// The rig that a plan is made for or checked against: the server's, or monitors given by hand.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/cli/client.h"
#include "core/pattern/plan_fit.h"

namespace glasswing {

struct RigLimitsArguments {
  bool for_rig = false;
  std::vector<std::string> monitors;  // NAME:WIDTHxHEIGHT
  double blur_px = 0.0;
};

// Adds --for-rig, --monitor and --blur.
void add_rig_limits_options(CLI::App& command, RigLimitsArguments& arguments);

// With --for-rig the server's monitors and `camera` (empty: any); those of --monitor replace the server's.
absl::StatusOr<RigLimits> read_rig_limits(const Client& client, const RigLimitsArguments& arguments,
                                          const std::string& camera);

// The same for making a plan, which needs monitors: the server's if none are named.
absl::StatusOr<RigLimits> read_plan_limits(const Client& client, const RigLimitsArguments& arguments);

}  // namespace glasswing
