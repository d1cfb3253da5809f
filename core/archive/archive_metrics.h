// Metrics of the transfer of archive frames (docs/monitoring.md).
#pragma once

#include "core/telemetry/metrics.h"

namespace glasswing {

struct ArchiveMetrics {
  prometheus::Counter& bytes_sent;         // of frames, to readers of this node
  prometheus::Counter& bytes_read_remote;  // of frames, from other nodes
  prometheus::Counter& bytes_read_local;   // of frames, from files on this machine
};

// The first call registers all of them, at 0.
inline const ArchiveMetrics& archive_metrics() {
  const auto read = [](const char* from) -> prometheus::Counter& {
    return counter("glasswing_archive_bytes_read_total",
                   "Bytes of frames read, from another node or a file here.", {{"from", from}});
  };
  static const ArchiveMetrics metrics{
      .bytes_sent = counter("glasswing_archive_bytes_sent_total", "Bytes of frames sent to readers."),
      .bytes_read_remote = read("node"),
      .bytes_read_local = read("file"),
  };
  return metrics;
}

}  // namespace glasswing
