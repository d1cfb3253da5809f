// What every program tells of its process, under the names that Prometheus' own libraries use.
#pragma once

#include <prometheus/metric_family.h>

#include <filesystem>
#include <vector>

namespace glasswing {

// As it is now: memory, CPU time, open descriptors, and since when it runs.
std::vector<prometheus::MetricFamily> process_metrics();

// Of the file system that holds `directory`: glasswing_disk_free_bytes and glasswing_disk_size_bytes; none if
// it cannot be asked.
std::vector<prometheus::MetricFamily> disk_metrics(const std::filesystem::path& directory);

}  // namespace glasswing
