// What a camera node tells monitoring of frames (docs/monitoring.md).
#pragma once

#include "core/telemetry/metrics.h"

namespace glasswing {

struct CameraMetrics {
  prometheus::Counter& frames;  // that the camera gave
  prometheus::Counter& kept;
  prometheus::Counter& refused;  // whose pixels do not prove their step
};

// Each is there, at 0, from the first call on.
inline const CameraMetrics& camera_metrics() {
  static const CameraMetrics metrics{
      .frames = counter("glasswing_camera_frames_total", "Frames that the camera gave."),
      .kept = counter("glasswing_frames_kept_total", "Proven frames that were written to archives."),
      .refused = counter("glasswing_frames_refused_total",
                         "Frames whose pixels show another id than that of their step."),
  };
  return metrics;
}

}  // namespace glasswing
