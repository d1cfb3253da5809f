// Metrics of a solver's tiles (docs/monitoring.md).
#pragma once

#include <chrono>

#include "core/telemetry/metrics.h"

namespace glasswing {

struct SolverMetrics {
  prometheus::Counter& solved;  // accepted by the server
  prometheus::Counter& failed;
  prometheus::Counter& lost;         // to another attempt, or the session was cancelled
  prometheus::Counter& handed_back;  // the solver was leaving
  prometheus::Counter& busy_seconds;
};

// The first call registers all of them at 0.
inline const SolverMetrics& solver_metrics() {
  const auto tiles = [](const char* outcome) -> prometheus::Counter& {
    return counter("glasswing_solver_tiles_total", "Tiles that this solver had, by how they ended.",
                   {{"outcome", outcome}});
  };
  static const SolverMetrics metrics{
      .solved = tiles("solved"),
      .failed = tiles("failed"),
      .lost = tiles("lost"),
      .handed_back = tiles("handed_back"),
      .busy_seconds = counter("glasswing_solver_busy_seconds_total", "Time in which it solved."),
  };
  return metrics;
}

// Counts its lifetime as busy.
class BusyTime {
 public:
  BusyTime() = default;
  ~BusyTime() {
    solver_metrics().busy_seconds.Increment(
        std::chrono::duration<double>(std::chrono::steady_clock::now() - since_).count());
  }
  BusyTime(const BusyTime&) = delete;
  BusyTime& operator=(const BusyTime&) = delete;

 private:
  const std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
};

}  // namespace glasswing
