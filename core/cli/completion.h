// Completion of the command line in shells: `glasswing completion SHELL` prints a short script, which calls
// `glasswing __complete -- WORDS...` at every Tab.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/cli/command_line.h"

namespace glasswing {

// The script for bash, zsh or fish.
std::string completion_script(std::string_view shell, std::string_view program);

// What may follow at the end of a command line: words with their descriptions (may be empty), or kFileMarker
// or kDirectoryMarker alone, where the shell is to complete names of files or directories.
using Candidates = std::vector<std::pair<std::string, std::string>>;
inline constexpr std::string_view kFileMarker = ":FILE", kDirectoryMarker = ":DIR";

// The values that a kind of argument may have ("SESSION", "NAME=VALUE"), for kinds that only a program knows.
// `words`: those before it.
using ValuesOfKind = std::function<Candidates(const std::string& kind, std::span<const std::string> words)>;

// `words`: those after the program's name, at least one; the last is to be completed and may be empty. After
// "--option=" the candidates are values alone.
Candidates candidates_for(const CLI::App& program, const std::vector<std::string>& words,
                          const ValuesOfKind& values_of_kind);

// The verbs completion and __complete.
void add_completion_commands(CLI::App& app, CommandLine& command_line, ValuesOfKind values_of_kind);

}  // namespace glasswing
