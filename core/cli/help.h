// The words of a command line about its options: for --help, manual pages and completion.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace glasswing {

// What may follow the option, where only certain words may: of CLI::IsMember.
std::vector<std::string> choices_of(const CLI::Option& option);

// What the option takes: "exr|png|tif", "NUMBER", "FILE"; empty for a flag.
std::string value_of(const CLI::Option& option);

// Its description, with what it may be and what it is if left out: "of a video (0.1 to 1000; default: 30)".
std::string description_of(const CLI::Option& option);

// The part of a command's footer before its examples, and the examples, one a line.
struct Footer {
  std::string text;
  std::vector<std::string> examples;
};
Footer footer_of(const CLI::App& command);

// Not the hidden ones.
std::vector<const CLI::App*> subcommands_of(const CLI::App& command);
std::vector<const CLI::Option*> options_of(const CLI::App& command);  // with a dash
std::vector<const CLI::Option*> positionals_of(const CLI::App& command);

// --help in these words, for a program and its subcommands declared afterwards.
void use_help_format(CLI::App& app);

}  // namespace glasswing
