// The server's metrics of captures, tiles and solvers (docs/monitoring.md).
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "core/telemetry/metrics.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "glasswing/v1/node_service.pb.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Counters, each present, as 0, from the first call on.
struct ServerMetrics {
  prometheus::Counter& steps_proven;
  prometheus::Counter& steps_retaken;
  prometheus::Counter& tiles_claimed;  // for the first time
  prometheus::Counter&
      tiles_claimed_again;  // after a failed, expired or returned attempt, or beside another solver
  prometheus::Counter& tiles_done;
  prometheus::Histogram& tile_seconds;  // from claim to result, measured by the solver
  prometheus::Counter& tiles_failed;    // attempts
  prometheus::Counter& tiles_quarantined;
};
const ServerMetrics& server_metrics();
// Steps that had to be shown again for this cause (core/pattern/describe_step.h).
prometheus::Counter& retakes_counter(std::string_view cause);

// Gauges, computed when monitoring asks. Tiles and solves are this server's own, also in a shared store. If
// the store does not answer, glasswing_job_store_up says so and its other metrics are missing.
std::vector<prometheus::MetricFamily> server_gauges(const absl::StatusOr<v1::GetFleetResponse>& fleet,
                                                    const std::vector<v1::Session>& sessions,
                                                    const std::vector<v1::Node>& nodes, size_t problem_count);

}  // namespace glasswing
