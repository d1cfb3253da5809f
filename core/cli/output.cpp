#include "core/cli/output.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "core/base/utf8.h"
#include "core/cli/colour.h"

namespace glasswing {
namespace {

// Characters of a UTF-8 text: all bytes but continuation bytes.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::ranges::count_if(text, [](char byte) { return (byte & 0xC0) != 0x80; }));
}

void print_tab_separated(const std::vector<std::string>& cells) {
  for (size_t c = 0; c < cells.size(); ++c) {
    std::string cell = cells[c];
    std::ranges::replace_if(
        cell, [](char byte) { return byte == '\t' || byte == '\n' || byte == '\r'; }, ' ');
    std::cout << (c > 0 ? "\t" : "") << cell;
  }
  std::cout << "\n";
}

void print_aligned(const std::vector<Column>& columns, const std::vector<size_t>& widths,
                   const std::vector<std::string>& cells, bool coloured) {
  std::string line;
  for (size_t c = 0; c < cells.size(); ++c) {
    const std::string room(widths[c] - width_of(cells[c]), ' ');
    const std::string cell =
        painted(cells[c], coloured && columns[c].title == "STATE" ? paint_of(cells[c]) : Paint::kNone);
    line += (c > 0 ? "  " : "") + (columns[c].right ? room + cell : cell + room);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  std::cout << line << "\n";
}

}  // namespace

void print_json(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  // Fails only for invalid Any or Timestamp values, which our messages do not have.
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  std::cout << json;
}

void print_table(const CommandLine& command_line, const std::vector<Column>& columns,
                 const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::vector<std::string>> lines(1);
  for (const Column& column : columns) lines[0].push_back(column.title);
  lines.insert(lines.end(), rows.begin(), rows.end());
  if (!command_line.tsv) {
    for (std::vector<std::string>& line : lines) std::ranges::transform(line, line.begin(), printable);
  }
  std::vector<size_t> widths(columns.size(), 0);
  for (const auto& line : lines) {
    for (size_t c = 0; c < widths.size(); ++c) widths[c] = std::max(widths[c], width_of(line[c]));
  }
  for (const auto& line : lines) {
    if (command_line.tsv) {
      print_tab_separated(line);
    } else {
      print_aligned(columns, widths, line, command_line.coloured);
    }
  }
}

std::string unsolved_text(std::int64_t pixels) {
  return pixels == 0 ? "" : fmt::format(", {} not solved", pixels);
}

absl::Status cannot_write(const std::string& output) {
  return absl::UnavailableError(
      fmt::format("cannot write {}; its directory must exist and be writable, with space on the disk",
                  output == "-" ? "standard output" : output));
}

std::string seconds_text(double seconds) {
  if (seconds < 59.95) return fmt::format("{:.1f} s", seconds);
  const long whole = std::lround(seconds);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace glasswing
