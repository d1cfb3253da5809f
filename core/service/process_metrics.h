// What every program tells of its process, under the names that Prometheus' own libraries use.
#pragma once

#include <prometheus/metric_family.h>

#include <vector>

namespace glasswing {

// As it is now: memory, CPU time, open descriptors, and since when it runs.
std::vector<prometheus::MetricFamily> process_metrics();

}  // namespace glasswing
