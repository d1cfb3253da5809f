// Completion of the command line for shells, made of the command line itself.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace glasswing {

// What a shell sources: commands, options, choices, files where FILE or DIR is meant, and for SESSION the
// sessions that the server knows (glasswing __sessions).
std::string bash_completion(const CLI::App& app);
std::string zsh_completion(const CLI::App& app);
std::string fish_completion(const CLI::App& app);

}  // namespace glasswing
