// The benchmark's figures, most with a goal.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace glasswing {

// Items per second of each Google Benchmark that ran, by name; medians of the repetitions.
using Rates = std::map<std::string, double>;

struct Row {
  std::string name;
  std::string unit;
  std::optional<double> goal;  // none: for comparison only
  bool at_most = false;        // otherwise at least
  // The benchmarks whose rate it needs; it is left out if they were filtered out.
  std::vector<std::string> needs;
  std::function<double(const Rates&)> value;
};

// Each function registers its Google Benchmarks and adds its rows.
void add_line_rows(std::vector<Row>& rows);
void add_joint_rows(std::vector<Row>& rows);
void add_accuracy_rows(std::vector<Row>& rows);
void add_solve_rows(std::vector<Row>& rows);
void add_camera_rows(std::vector<Row>& rows);
void add_ramp_rows(std::vector<Row>& rows);
void add_composite_rows(std::vector<Row>& rows);

}  // namespace glasswing
