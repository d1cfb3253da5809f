// The figures that are measured within one process; tests/bench/run judges them.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <regex>

#include "core/file/file.h"
#include "core/process/freed_memory.h"
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
      "Measures the solver, the simulated camera, ramp mattes and composites; tests/bench/run holds the rows "
      "against their goals.\n\nExample:  build/release/bin/glasswing-bench --filter 'joint fit'"};
  std::string filter = ".*", large;
  bool list = false;
  app.add_option("--filter", filter, "Only rows whose names match this regular expression");
  app.add_flag("--list", list, "Print the rows without values; measure nothing");
  app.add_option("--large-matte", large, "Write a matte of 12 megapixels to this file; measure nothing");
  CLI11_PARSE(app, argc, argv);
  if (!large.empty()) {
    const absl::Status written = write_file_durably(large, large_matte());
    if (!written.ok()) fmt::print(stderr, "glasswing-bench: {}\n", std::string(written.message()));
    return written.ok() ? 0 : 1;
  }
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
  if (list) {
    for (const Row& row : rows) fmt::print("{{\"name\":\"{}\",\"unit\":\"{}\"}}\n", row.name, row.unit);
    return 0;
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

  for (const Row& row : rows) print_row(row.name, row.value(collector.rates), row.unit);
  return 0;
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  glasswing::keep_freed_memory();  // as glasswing-solver does
  return glasswing::run(argc, argv);
}
