// Descriptions of a command line's options, for --help, manual pages and completion.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace glasswing {

// The values that the option accepts, if CLI::IsMember restricts them.
std::vector<std::string> choices_of(const CLI::Option& option);

// A placeholder for the option's value: "exr|png|tif", "NUMBER", "FILE"; empty for a flag.
std::string value_of(const CLI::Option& option);

// Its description with its range and default: "of a video (0.1 to 1000; default: 30)".
std::string description_of(const CLI::Option& option);

// A line of a list under a command's options: a name and its description, wrapped as theirs are.
std::string help_entry(const std::string& name, const std::string& description);

// A command's footer: the text before its examples, and the examples, one per line.
struct Footer {
  std::string text;
  std::vector<std::string> examples;
};
Footer footer_of(const CLI::App& command);

// Hidden ones are left out.
std::vector<const CLI::App*> subcommands_of(const CLI::App& command);
std::vector<const CLI::Option*> options_of(const CLI::App& command);  // those with a dash
std::vector<const CLI::Option*> positionals_of(const CLI::App& command);

// Formats --help with the above, for a program and the subcommands declared afterwards.
void use_help_format(CLI::App& app);

}  // namespace glasswing
