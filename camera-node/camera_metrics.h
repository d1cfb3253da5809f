// The camera node's metrics of frames (docs/monitoring.md).
#pragma once

#include "core/telemetry/metrics.h"

namespace glasswing {

struct CameraMetrics {
  prometheus::Counter& frames;  // delivered by the camera
  prometheus::Counter& incomplete;
  prometheus::Counter& missing_packets;
  prometheus::Counter& kept;
  prometheus::Counter& refused;  // their pixels show another id than their step's
};

// All are exported, at 0, from the first call on.
inline const CameraMetrics& camera_metrics() {
  static const CameraMetrics metrics{
      .frames = counter("glasswing_camera_frames_total", "Frames that the camera delivered."),
      .incomplete = counter("glasswing_camera_incomplete_frames_total",
                            "Frames that were dropped because part of their data did not arrive."),
      .missing_packets = counter("glasswing_camera_missing_packets_total",
                                 "Packets of frames that did not arrive, even when requested again."),
      .kept = counter("glasswing_frames_kept_total", "Proven frames that were written to archives."),
      .refused = counter("glasswing_frames_refused_total",
                         "Frames whose pixels show a different id from their "
                         "step's."),
  };
  return metrics;
}

}  // namespace glasswing
