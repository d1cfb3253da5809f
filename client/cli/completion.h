// Completion of the command line in shells: `glasswing completion SHELL` prints a short script, which calls
// `glasswing __complete -- WORDS...` at every Tab.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace glasswing {

// The script for bash, zsh or fish.
std::string_view completion_script(std::string_view shell);

// What may follow at the end of a command line: words with their descriptions (may be empty), or kFileMarker
// or kDirectoryMarker alone, where the shell is to complete names of files or directories.
using Candidates = std::vector<std::pair<std::string, std::string>>;
inline constexpr std::string_view kFileMarker = ":FILE", kDirectoryMarker = ":DIR";

// `words`: those after the program's name, at least one; the last is to be completed and may be empty. After
// "--option=" the candidates are values alone. Names of sessions come from the server that the words name, or
// else the environment or the configuration file; there are none if it does not answer.
Candidates candidates_for(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace glasswing
