// Metrics for Prometheus, in its text format at http://HOST:PORT/metrics.
//
// Names have the form glasswing_WHAT_UNIT, and end in _total for counters; docs/monitoring.md lists them all.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <prometheus/counter.h>
#include <prometheus/exposer.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/labels.h>
#include <prometheus/metric_family.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace glasswing {

// The process's metric of this name and these labels, created on first use, never destroyed. All uses of a
// name must agree in kind, help and bounds. Thread-safe.
prometheus::Counter& counter(const std::string& name, const std::string& help,
                             const prometheus::Labels& labels = {});
prometheus::Gauge& gauge(const std::string& name, const std::string& help,
                         const prometheus::Labels& labels = {});
// `bounds`: the buckets' upper bounds, rising; larger values are counted in a bucket of their own.
prometheus::Histogram& histogram(const std::string& name, const std::string& help,
                                 const std::vector<double>& bounds, const prometheus::Labels& labels = {});

// Gauges that are computed on request: a value for each set of labels.
using LabelledValues = std::vector<std::pair<prometheus::Labels, double>>;
prometheus::MetricFamily gauges(const std::string& name, const std::string& help,
                                const LabelledValues& values);

// Adds the metrics that `collect` returns to every answer, until destroyed.
class AskedMetrics {
 public:
  explicit AskedMetrics(std::function<std::vector<prometheus::MetricFamily>()> collect);
  ~AskedMetrics();  // waits for a running call of `collect`
  AskedMetrics(const AskedMetrics&) = delete;
  AskedMetrics& operator=(const AskedMetrics&) = delete;

 private:
  const int key_;
};

// The current values of all metrics.
std::vector<prometheus::MetricFamily> collect_metrics();

struct MetricsOptions {
  std::string address;  // host:port to listen on; port 0: any free one; empty: nowhere
  std::string program, build;
};

// Declares --metrics.
void add_metrics_option(CLI::App& app, MetricsOptions& options);

// Answers GET /metrics.
class MetricsHost {
 public:
  // Null if the address is empty. INVALID_ARGUMENT: it is not a loopback HOST:PORT (there is no TLS here).
  // UNAVAILABLE: it is in use.
  static absl::StatusOr<std::unique_ptr<MetricsHost>> start(const MetricsOptions& options);

  const std::string& address() const { return address_; }  // with the real port

 private:
  MetricsHost() = default;
  std::string address_;
  std::shared_ptr<prometheus::Collectable> all_;
  std::unique_ptr<prometheus::Exposer> exposer_;
};

}  // namespace glasswing
