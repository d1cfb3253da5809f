// Metrics of what a display node shows (docs/monitoring.md).
#pragma once

#include "core/telemetry/metrics.h"

namespace glasswing {

struct DisplayMetrics {
  prometheus::Counter& steps_shown;
  prometheus::Counter& steps_late;  // a refresh or more after the first possible one, on any monitor
  prometheus::Counter& pulses_skipped;
};

// All of them exist, at 0, from the first call on.
inline const DisplayMetrics& display_metrics() {
  static const DisplayMetrics metrics{
      .steps_shown = counter("glasswing_steps_shown_total", "Steps shown on the monitors."),
      .steps_late = counter("glasswing_steps_late_total", "Steps shown on a monitor a refresh or more late."),
      .pulses_skipped =
          counter("glasswing_line_pulses_skipped_total",
                  "Pictures without a pulse of the trigger line, which would have come too late."),
  };
  return metrics;
}

}  // namespace glasswing
