// Logs of a daemon: lines "words key=value key="words too"" on standard error, as text for people or as JSON
// for machines.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace glasswing {

struct LogOptions {
  std::string level = "info";   // debug, info, warn or error
  std::string format = "text";  // or json
};

// Declares --log-level and --log-format.
void add_log_options(CLI::App& app, LogOptions& options);

// From now on, in the whole process. One line each; as text: time, level, program, message.
void start_logging(const std::string& program, const LogOptions& options);

// A message and the fields at its end: a name of [a-z0-9_], "=", and what stands up to the next space, or
// between a quote and the last one before the next field. What is not at the end stays in the words.
struct LogMessage {
  std::string words;
  std::vector<std::pair<std::string, std::string>> fields;
};
LogMessage split_message(std::string_view message);

// One JSON object on one line: time, level, program, message, and the message's fields, all strings, so that
// what kind a field is never depends on its value. A field of one of those names, or that is there twice,
// gets a "_" behind its name. Bytes that are no UTF-8 become U+FFFD.
std::string json_line(std::chrono::system_clock::time_point time, std::string_view level,
                      std::string_view program, std::string_view message);

}  // namespace glasswing
