#include "server/metrics/server_metrics.h"

#include <algorithm>
#include <map>

#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

prometheus::Counter& claims(const char* attempt) {
  return counter("glasswing_tiles_claimed_total",
                 "Tiles handed out: first, or again because an attempt failed, ended or is slow.",
                 {{"attempt", attempt}});
}

const char* state_of(const v1::FleetSolver& solver) {
  if (!solver.up()) return "away";
  return solver.refused().empty() ? "up" : "refused";
}

void add_fleet(const v1::GetFleetResponse& fleet, std::vector<prometheus::MetricFamily>& families) {
  std::map<std::string, double> solvers{{"up", 0.0}, {"away", 0.0}, {"refused", 0.0}};
  double twice = 0.0;
  for (const v1::FleetSolver& solver : fleet.solvers()) {
    ++solvers[state_of(solver)];
    twice += static_cast<double>(std::ranges::count_if(solver.leases(), &v1::FleetLease::twice));
  }
  std::map<std::string, double> tiles{{"waiting", 0.0}, {"held", 0.0}, {"leased", 0.0}, {"quarantined", 0.0}};
  double solving = 0.0;
  for (const v1::FleetSolve& solve : fleet.solves()) {
    if (!solve.server().empty()) continue;
    const int waiting = solve.tile_count() - solve.tiles_done() - solve.tiles_leased() - solve.quarantined();
    tiles[solve.held() ? "held" : "waiting"] += std::max(waiting, 0);
    tiles["leased"] += solve.tiles_leased();
    tiles["quarantined"] += solve.quarantined();
    if (!solve.held()) ++solving;
  }
  const auto by_state = [](const std::map<std::string, double>& counts) {
    LabelledValues values;
    for (const auto& [state, count] : counts) values.push_back({{{"state", state}}, count});
    return values;
  };
  families.push_back(gauges("glasswing_solvers", "Solvers that this server knows.", by_state(solvers)));
  families.push_back(gauges("glasswing_tiles", "Unfinished tiles of unfinished solves.", by_state(tiles)));
  families.push_back(gauges("glasswing_leases_twice",
                            "Leases of tiles held by two solvers, of which the first result counts.",
                            {{{}, twice}}));
  families.push_back(
      gauges("glasswing_solves_running", "Solves whose tiles are handed out.", {{{}, solving}}));
}

}  // namespace

prometheus::Counter& retakes_counter(std::string_view cause) {
  return counter("glasswing_retakes_total", "Steps that had to be shown again, by cause.",
                 {{"cause", std::string(cause)}});
}

const ServerMetrics& server_metrics() {
  static const ServerMetrics metrics{
      .steps_proven = counter("glasswing_steps_proven_total", "Steps of captures with a proven frame."),
      .steps_retaken = counter("glasswing_steps_retaken_total", "Repeated showings of steps."),
      .tiles_claimed = claims("first"),
      .tiles_claimed_again = claims("again"),
      .tiles_done = counter("glasswing_tiles_done_total", "Tiles whose result is durable."),
      .tile_seconds = histogram("glasswing_tile_seconds",
                                "From a tile's claim to its result; tiles are cut to take 0.5 to 5 s.",
                                {0.05, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 5, 7.5, 10, 20, 60}),
      .tiles_failed = counter("glasswing_tiles_failed_total", "Attempts at tiles that failed."),
      .tiles_quarantined =
          counter("glasswing_tiles_quarantined_total", "Tiles given up until the solve is retried."),
  };
  return metrics;
}

std::vector<prometheus::MetricFamily> server_gauges(const absl::StatusOr<v1::GetFleetResponse>& fleet,
                                                    const std::vector<v1::Session>& sessions,
                                                    const std::vector<v1::Node>& nodes,
                                                    size_t problem_count) {
  std::vector<prometheus::MetricFamily> families;
  families.push_back(
      gauges("glasswing_job_store_up", "1: the job store answers.", {{{}, fleet.ok() ? 1.0 : 0.0}}));
  if (fleet.ok()) add_fleet(*fleet, families);
  std::map<std::string, double> counts;
  for (int state = v1::SESSION_STATE_CREATED; v1::SessionState_IsValid(state); ++state) {
    v1::Session any;
    any.set_state(static_cast<v1::SessionState>(state));
    counts[state_of(any)] = 0.0;
  }
  for (const v1::Session& session : sessions) ++counts[state_of(session)];
  LabelledValues by_state;
  for (const auto& [state, count] : counts) by_state.push_back({{{"state", state}}, count});
  families.push_back(gauges("glasswing_sessions", "Sessions in the catalogue.", by_state));
  families.push_back(gauges("glasswing_server_problems",
                            "Problems with the server's own data or job store; glasswing doctor lists them.",
                            {{{}, static_cast<double>(problem_count)}}));
  LabelledValues up;
  for (const v1::Node& node : nodes) {
    if (node.kind() == v1::NODE_KIND_SOLVER) continue;  // solvers come and go; glasswing_solvers counts them
    const char* kind = node.kind() == v1::NODE_KIND_CAMERA ? "camera" : "display";
    up.push_back({{{"kind", kind}, {"name", node.name()}}, node.up() ? 1.0 : 0.0});
  }
  families.push_back(gauges("glasswing_node_up", "1: the display or camera node is up; 0: unavailable.", up));
  return families;
}

}  // namespace glasswing
