#include "core/telemetry/logs.h"

#include <absl/time/time.h>
#include <fmt/format.h>
#include <grpc/support/log.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/base/utf8.h"

namespace glasswing {
namespace {

using Field = std::pair<std::string, std::string>;

// The length of the name and "=" that the text begins with; 0: it begins with neither.
size_t name_length(std::string_view text) {
  const auto is_in_name = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; };
  size_t length = 0;
  while (length < text.size() && is_in_name(text[length])) ++length;
  return length > 0 && length < text.size() && text[length] == '=' ? length + 1 : 0;
}

bool is_before_field(std::string_view rest) {
  return rest.empty() || (rest.front() == ' ' && name_length(rest.substr(1)) > 0);
}

// Removes a field from the beginning of the text, with the space after it.
std::optional<Field> take_field(std::string_view& text) {
  const size_t name = name_length(text);
  if (name == 0) return std::nullopt;
  size_t end = std::min(text.find(' ', name), text.size());
  std::string_view value = text.substr(name, end - name);
  if (!value.empty() && value.front() == '"') {
    end = text.find('"', name + 1);
    while (end != std::string_view::npos && !is_before_field(text.substr(end + 1)))
      end = text.find('"', end + 1);
    if (end == std::string_view::npos) return std::nullopt;
    value = text.substr(name + 1, end - name - 1);
    ++end;
  }
  Field field(text.substr(0, name - 1), value);
  text.remove_prefix(std::min(end + 1, text.size()));
  return field;
}

std::string rfc3339(std::chrono::system_clock::time_point time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::FromChrono(time), absl::UTCTimeZone());
}

std::string_view view_of(spdlog::string_view_t text) {
  return {text.data(), text.size()};
}

// Words of others stay within their line.
class MessageFormatter final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& log, const std::tm&, spdlog::memory_buf_t& to) override {
    const std::string line = printable(view_of(log.payload));
    to.append(line.data(), line.data() + line.size());
  }
  std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<MessageFormatter>();
  }
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& log, spdlog::memory_buf_t& to) override {
    const std::string line = json_line(log.time, view_of(spdlog::level::to_string_view(log.level)),
                                       view_of(log.logger_name), view_of(log.payload));
    to.append(line.data(), line.data() + line.size());
    to.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

// Keeps the newest lines for logged_warnings().
class WarningSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  std::vector<LoggedLine> lines() {
    const std::lock_guard lock(mutex_);
    return {lines_.begin(), lines_.end()};
  }

 private:
  void sink_it_(const spdlog::details::log_msg& log) override {
    std::string text = printable(view_of(log.payload));
    if (text.size() > kMaxLoggedBytes) {
      // Not within a character.
      size_t end = kMaxLoggedBytes;
      while ((static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
      text.resize(end);
    }
    if (lines_.size() == kMaxLoggedLines) lines_.pop_front();
    lines_.push_back({.time = rfc3339(log.time),
                      .level = std::string(view_of(spdlog::level::to_string_view(log.level))),
                      .text = std::move(text)});
  }
  void flush_() override {}

  std::deque<LoggedLine> lines_;  // guarded by mutex_
};

const std::shared_ptr<WarningSink>& warning_sink() {
  static const auto sink = std::make_shared<WarningSink>();
  return sink;
}

// gRPC's own lines. Errors of its peers, such as failed handshakes, are none of this program's.
void log_of_grpc(gpr_log_func_args* args) {
  const spdlog::level::level_enum level = args->severity == GPR_LOG_SEVERITY_ERROR  ? spdlog::level::warn
                                          : args->severity == GPR_LOG_SEVERITY_INFO ? spdlog::level::info
                                                                                    : spdlog::level::debug;
  const std::string_view file(args->file);
  spdlog::log(level, "gRPC: {} source={}:{}", args->message, file.substr(file.rfind('/') + 1), args->line);
}

}  // namespace

void add_log_options(CLI::App& app, LogOptions& options) {
  app.add_option("--log-level", options.level, "the lowest level that is logged")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  app.add_option("--log-format", options.format, "lines for people, or a JSON object per line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

void start_logging(const std::string& program, const LogOptions& options) {
  const auto console = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  const auto logger =
      std::make_shared<spdlog::logger>(program, spdlog::sinks_init_list{console, warning_sink()});
  if (options.format == "json") {
    console->set_formatter(std::make_unique<JsonFormatter>());
  } else {
    auto lines = std::make_unique<spdlog::pattern_formatter>(spdlog::pattern_time_type::utc);
    lines->add_flag<MessageFormatter>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %n: %*");
    console->set_formatter(std::move(lines));
  }
  const spdlog::level::level_enum level = spdlog::level::from_str(options.level);
  console->set_level(level);
  warning_sink()->set_level(spdlog::level::warn);
  logger->set_level(std::min(level, spdlog::level::warn));
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(logger);
  gpr_set_log_function(&log_of_grpc);
}

std::vector<LoggedLine> logged_warnings() {
  return warning_sink()->lines();
}

LogMessage split_message(std::string_view message) {
  std::vector<Field> fields;
  size_t words_end = message.size();
  // Fields followed by words belong to the words.
  for (size_t at = 0; at < message.size();) {
    std::string_view rest = message.substr(at);
    if (std::optional<Field> field = take_field(rest)) {
      if (fields.empty()) words_end = at;
      fields.push_back(*std::move(field));
      at = message.size() - rest.size();
    } else {
      fields.clear();
      words_end = message.size();
      const size_t space = message.find(' ', at);
      if (space == std::string_view::npos) break;
      at = space + 1;
    }
  }
  std::string_view words = message.substr(0, words_end);
  if (!fields.empty() && !words.empty()) words.remove_suffix(1);  // the space between
  return {.words = std::string(words), .fields = std::move(fields)};
}

std::string json_line(std::chrono::system_clock::time_point time, std::string_view level,
                      std::string_view program, std::string_view message) {
  const LogMessage split = split_message(message);
  nlohmann::ordered_json line{
      {"time", rfc3339(time)}, {"level", level}, {"program", program}, {"message", split.words}};
  for (const auto& [name, value] : split.fields) {
    std::string free = name;
    while (line.contains(free)) free += '_';
    line[free] = value;
  }
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace glasswing
