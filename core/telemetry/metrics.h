// What monitoring reads of a process: numbers by name, at http://HOST:PORT/metrics in the text form of
// Prometheus.
//
// A name is glasswing_WHAT_UNIT, a counter's ends in _total; docs/monitoring.md lists them all.
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

// The process's one of this name and these labels, made when it is first asked for; it lives for ever. A name
// stands for one kind, help and set of bounds. Thread-safe.
prometheus::Counter& counter(const std::string& name, const std::string& help,
                             const prometheus::Labels& labels = {});
prometheus::Gauge& gauge(const std::string& name, const std::string& help,
                         const prometheus::Labels& labels = {});
// `bounds`: upper ones of the buckets, rising; what is larger than all is counted too.
prometheus::Histogram& histogram(const std::string& name, const std::string& help,
                                 const std::vector<double>& bounds, const prometheus::Labels& labels = {});

// Gauges that are looked up when somebody asks: a value for each set of labels.
using LabelledValues = std::vector<std::pair<prometheus::Labels, double>>;
prometheus::MetricFamily gauges(const std::string& name, const std::string& help,
                                const LabelledValues& values);

// Adds what `collect` returns to every answer, for as long as it lives.
class AskedMetrics {
 public:
  explicit AskedMetrics(std::function<std::vector<prometheus::MetricFamily>()> collect);
  ~AskedMetrics();  // waits for a call that runs
  AskedMetrics(const AskedMetrics&) = delete;
  AskedMetrics& operator=(const AskedMetrics&) = delete;

 private:
  const int key_;
};

// Everything, as it is now.
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
  // Null if the address is empty. INVALID_ARGUMENT: it is no HOST:PORT of this machine's loopback (there is
  // no TLS here); UNAVAILABLE: it cannot be listened on.
  static absl::StatusOr<std::unique_ptr<MetricsHost>> start(const MetricsOptions& options);

  const std::string& address() const { return address_; }  // with the real port

 private:
  MetricsHost() = default;
  std::string address_;
  std::shared_ptr<prometheus::Collectable> all_;
  std::unique_ptr<prometheus::Exposer> exposer_;
};

}  // namespace glasswing
