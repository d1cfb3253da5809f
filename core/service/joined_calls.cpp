#include "core/service/joined_calls.h"

#include "core/telemetry/metrics.h"

namespace glasswing {

prometheus::Counter& joined_calls() {
  static prometheus::Counter& joined =
      counter("glasswing_calls_joined_total",
              "Repetitions of a call that were joined to the first, which was still at work or just done.");
  return joined;
}

}  // namespace glasswing
