// tests/bench/run: measures every promised figure in one run.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "core/base/freed_memory.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

// Keeps the medians.
class Collector : public benchmark::ConsoleReporter {
 public:
  Collector() : ConsoleReporter(OO_None) {}
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      const auto rate = run.counters.find("items_per_second");
      if (run.aggregate_name == "median" && rate != run.counters.end()) {
        rates[run.run_name.function_name] = rate->second;
      }
    }
  }
  Rates rates;
};

int run(int argc, char** argv) {
  CLI::App app{
      "Measures the figures that the solver must meet.\n\nExample:  tests/bench/run --json figures.json"};
  std::string json, filter = ".*";
  app.add_option("--json", json, "File for the rows as JSON");
  app.add_option("--filter", filter, "Only rows whose names match this regular expression");
  CLI11_PARSE(app, argc, argv);
  std::vector<Row> all, rows;
  add_line_rows(all);
  add_joint_rows(all);
  add_accuracy_rows(all);
  add_solve_rows(all);
  add_camera_rows(all);
  add_ramp_rows(all);
  add_composite_rows(all);
  const std::regex wanted(filter);
  std::string benchmarks;
  for (const Row& row : all) {
    if (!std::regex_search(row.name, wanted)) continue;
    rows.push_back(row);
    for (const std::string& need : row.needs) benchmarks += (benchmarks.empty() ? "^" : "|^") + need + "$";
  }
  // Repetitions are interleaved at random, so that ratios compare the same machine state.
  std::vector<std::string> flags{argv[0],
                                 "--benchmark_repetitions=7",
                                 "--benchmark_enable_random_interleaving=true",
                                 "--benchmark_min_time=0.15",
                                 "--benchmark_report_aggregates_only=true",
                                 "--benchmark_filter=" + (benchmarks.empty() ? "^$" : benchmarks)};
  std::vector<char*> flag_pointers;
  for (std::string& flag : flags) flag_pointers.push_back(flag.data());
  int flag_count = static_cast<int>(flags.size());
  benchmark::Initialize(&flag_count, flag_pointers.data());
  Collector collector;
  if (!benchmarks.empty()) benchmark::RunSpecifiedBenchmarks(&collector);

  nlohmann::json list = nlohmann::json::array();
  fmt::print("\n{:<64} {:>10} {:>10} {:<14} {}\n", "figure", "value", "goal", "unit", "met");
  for (const Row& row : rows) {
    const double value = row.value(collector.rates);
    nlohmann::json entry = {{"name", row.name}, {"value", value}, {"unit", row.unit}};
    std::string goal, met;
    if (row.goal) {
      const bool is_met = row.at_most ? value <= *row.goal : value >= *row.goal;
      goal = fmt::format("{} {:.4g}", row.at_most ? "<=" : ">=", *row.goal);
      met = is_met ? "yes" : "NO";
      entry["goal"] = *row.goal;
      entry["met"] = is_met;
    }
    fmt::print("{:<64} {:>10.4g} {:>10} {:<14} {}\n", row.name, value, goal, row.unit, met);
    std::fflush(stdout);
    list.push_back(std::move(entry));
  }
  if (!json.empty()) std::ofstream(json) << nlohmann::json{{"rows", list}}.dump(2) << "\n";
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  glasswing::keep_freed_memory();  // as glasswing-solver does
  return glasswing::run(argc, argv);
}
