// Metrics of the process itself, under the names that Prometheus' own libraries use.
#pragma once

#include <prometheus/metric_family.h>

#include <filesystem>
#include <vector>

namespace glasswing {

// Current memory, CPU time and open descriptors, and the start time.
std::vector<prometheus::MetricFamily> process_metrics();

// glasswing_disk_free_bytes and glasswing_disk_size_bytes of the file system that holds `directory`; empty if
// they cannot be read.
std::vector<prometheus::MetricFamily> disk_metrics(const std::filesystem::path& directory);

}  // namespace glasswing
