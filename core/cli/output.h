// Writes answers to standard output, and reports why a file was not written.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/cli/amount.h"
#include "core/cli/command_line.h"

namespace glasswing {

// Protobuf's JSON mapping, with the field names of the .proto files; fields with default values are included.
void print_json(const google::protobuf::Message& message);

struct Column {
  std::string title;   // "NAME"
  bool right = false;  // right-aligned, for numbers
};
// Prints aligned columns under their titles; with --tsv tab-separated values with a header row (tabs and line
// breaks within a cell become spaces). Each row has one cell per column. The column STATE is coloured.
// Commands write their JSON themselves.
void print_table(const CommandLine& command_line, const std::vector<Column>& columns,
                 const std::vector<std::vector<std::string>>& rows);

// ", 189 not solved"; empty: none.
std::string unsolved_text(std::int64_t pixels);

// UNAVAILABLE. `output` is a path, or "-" for standard output.
absl::Status cannot_write(const std::string& output);

// "9.2 s", "3 min 20 s"
std::string seconds_text(double seconds);

}  // namespace glasswing
