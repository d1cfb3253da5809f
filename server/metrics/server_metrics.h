// What the server tells monitoring of captures, tiles and solvers (docs/monitoring.md).
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "core/telemetry/metrics.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "glasswing/v1/node_service.pb.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Those that count. Each is there, at 0, from the first call on.
struct ServerMetrics {
  prometheus::Counter& steps_proven;
  prometheus::Counter& steps_retaken;
  prometheus::Counter& tiles_claimed;        // for the first time
  prometheus::Counter& tiles_claimed_again;  // failed, expired, handed back, or somebody else has it too
  prometheus::Counter& tiles_done;
  prometheus::Histogram& tile_seconds;  // from claim to result, as the solver measured it
  prometheus::Counter& tiles_failed;    // attempts
  prometheus::Counter& tiles_quarantined;
};
const ServerMetrics& server_metrics();

// Those that are looked up when monitoring asks. Tiles and solves are this server's own, of a store that
// others share too. Without the store's answer, only glasswing_job_store_up tells of it.
std::vector<prometheus::MetricFamily> server_gauges(const absl::StatusOr<v1::GetFleetResponse>& fleet,
                                                    const std::vector<v1::Session>& sessions,
                                                    const std::vector<v1::Node>& nodes);

}  // namespace glasswing
