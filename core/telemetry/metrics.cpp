#include "core/telemetry/metrics.h"

#include <fmt/format.h>
#include <prometheus/registry.h>

#include <map>
#include <mutex>

#include "core/base/address.h"
#include "core/base/version.h"
#include "core/security/tls.h"
#include "core/telemetry/process_metrics.h"

namespace glasswing {
namespace {

struct Metrics {
  prometheus::Registry registry;
  std::mutex mutex;
  int last_key = 0;
  std::map<int, std::function<std::vector<prometheus::MetricFamily>()>> asked;
};

// Never destroyed: threads may count until the process ends.
Metrics& metrics() {
  static Metrics& all = *new Metrics;
  return all;
}

void append(std::vector<prometheus::MetricFamily>& families, std::vector<prometheus::MetricFamily> more) {
  for (prometheus::MetricFamily& family : more) families.push_back(std::move(family));
}

class AllMetrics final : public prometheus::Collectable {
 public:
  explicit AllMetrics(const MetricsOptions& options) : options_(options) {}

  std::vector<prometheus::MetricFamily> Collect() const override {
    std::vector<prometheus::MetricFamily> families = collect_metrics();
    families.push_back(
        gauges("glasswing_build_info", "1; the labels say what runs.",
               {{{{"program", options_.program}, {"version", kVersion}, {"build", options_.build}}, 1.0}}));
    append(families, process_metrics());
    return families;
  }

 private:
  const MetricsOptions options_;
};

}  // namespace

prometheus::Counter& counter(const std::string& name, const std::string& help,
                             const prometheus::Labels& labels) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(metrics().registry).Add(labels);
}

prometheus::Gauge& gauge(const std::string& name, const std::string& help, const prometheus::Labels& labels) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(metrics().registry).Add(labels);
}

prometheus::Histogram& histogram(const std::string& name, const std::string& help,
                                 const std::vector<double>& bounds, const prometheus::Labels& labels) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(metrics().registry).Add(labels, bounds);
}

prometheus::MetricFamily gauges(const std::string& name, const std::string& help,
                                const LabelledValues& values) {
  prometheus::MetricFamily family{
      .name = name, .help = help, .type = prometheus::MetricType::Gauge, .metric = {}};
  for (const auto& [labels, value] : values) {
    prometheus::ClientMetric& metric = family.metric.emplace_back();
    for (const auto& [label, text] : labels) metric.label.push_back({.name = label, .value = text});
    metric.gauge.value = value;
  }
  return family;
}

AskedMetrics::AskedMetrics(std::function<std::vector<prometheus::MetricFamily>()> collect)
    : key_([&] {
        const std::lock_guard lock(metrics().mutex);
        const int key = ++metrics().last_key;
        metrics().asked[key] = std::move(collect);
        return key;
      }()) {}

AskedMetrics::~AskedMetrics() {
  const std::lock_guard lock(metrics().mutex);
  metrics().asked.erase(key_);
}

std::vector<prometheus::MetricFamily> collect_metrics() {
  std::vector<prometheus::MetricFamily> families = metrics().registry.Collect();
  const std::lock_guard lock(metrics().mutex);
  for (const auto& [key, collect] : metrics().asked) append(families, collect());
  return families;
}

void add_metrics_option(CLI::App& app, MetricsOptions& options) {
  app.add_option("--metrics", options.address,
                 "host:port to serve /metrics at, for Prometheus; loopback only; default: none");
}

absl::StatusOr<std::unique_ptr<MetricsHost>> MetricsHost::start(const MetricsOptions& options) {
  if (options.address.empty()) return nullptr;
  absl::StatusOr<Address> address = parse_address(options.address);
  if (!address.ok() || !is_loopback(options.address)) {
    return absl::InvalidArgumentError(fmt::format(
        "--metrics is {}; it must be a loopback address, such as 127.0.0.1:9440 (docs/monitoring.md tells "
        "how other machines read it)",
        options.address));
  }
  std::unique_ptr<MetricsHost> self(new MetricsHost);
  try {
    self->exposer_ = std::make_unique<prometheus::Exposer>(options.address);
  } catch (const std::exception&) {
    return absl::UnavailableError(
        fmt::format("cannot listen on {} (--metrics); is another program running there?", options.address));
  }
  self->all_ = std::make_shared<AllMetrics>(options);
  self->exposer_->RegisterCollectable(self->all_);
  address->port = self->exposer_->GetListeningPorts().front();
  self->address_ = text_of(*address);
  return self;
}

}  // namespace glasswing
