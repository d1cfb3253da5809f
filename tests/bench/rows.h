// The benchmark's figures. tests/goals.toml has their goals.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace glasswing {

// Items per second of each Google Benchmark that ran, by name; medians of the repetitions.
using Rates = std::map<std::string, double>;

struct Row {
  std::string name;
  std::string unit;
  // The benchmarks whose rate it needs; it is left out if they were filtered out.
  std::vector<std::string> needs;
  std::function<double(const Rates&)> value;
};

// Prints a row, for tests/bench/run, as a line of JSON.
inline void print_row(const std::string& name, double value, const std::string& unit) {
  fmt::print("{{\"name\":\"{}\",\"unit\":\"{}\",\"value\":{}}}\n", name, unit,
             std::isfinite(value) ? fmt::to_string(value) : "null");
  std::fflush(stdout);
}

// Each function registers its Google Benchmarks and adds its rows.
void add_line_rows(std::vector<Row>& rows);
void add_joint_rows(std::vector<Row>& rows);
void add_accuracy_rows(std::vector<Row>& rows);
void add_solve_rows(std::vector<Row>& rows);
void add_camera_rows(std::vector<Row>& rows);
void add_ramp_rows(std::vector<Row>& rows);
void add_composite_rows(std::vector<Row>& rows);
// A matte's file of 12 megapixels, two modes a channel, before a monitor as large.
std::string large_matte();

}  // namespace glasswing
