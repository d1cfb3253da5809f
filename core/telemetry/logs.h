// A daemon's log: lines of the form "words key=value key="words too"" on standard error, as text or as JSON.
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

// Starts logging in the whole process, one line per message (printable(), core/base/utf8.h); gRPC's too. A
// text line holds time, level, program, message.
void start_logging(const std::string& program, const LogOptions& options);

// A warning or error that this process logged.
struct LoggedLine {
  std::string time;   // RFC 3339, UTC
  std::string level;  // "warning", "error" or "critical"
  std::string text;   // printable(), at most kMaxLoggedBytes
};
inline constexpr size_t kMaxLoggedLines = 200, kMaxLoggedBytes = 2000;
// The newest kMaxLoggedLines since start_logging(), oldest first, whatever --log-level says. Thread-safe.
std::vector<LoggedLine> logged_warnings();

// A message and the fields at its end. A field is a name of [a-z0-9_], "=", and a value that ends at the next
// space, or, if quoted, at the last quote before the next field. Fields followed by words are words.
struct LogMessage {
  std::string words;
  std::vector<std::pair<std::string, std::string>> fields;
};
LogMessage split_message(std::string_view message);

// One JSON object on one line: time, level, program, message, and the message's fields, all of them strings,
// so that a field's type never depends on its value. A "_" is appended to a field's name if the name is
// taken. Bytes that are not UTF-8 become U+FFFD.
std::string json_line(std::chrono::system_clock::time_point time, std::string_view level,
                      std::string_view program, std::string_view message);

}  // namespace glasswing
