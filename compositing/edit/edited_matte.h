// What the verbs of "glasswing matte" share: a matte is read, edited, and written with a note of the edit.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/cli/command_line.h"
#include "core/matte/matte_file.h"

namespace glasswing {

struct EditArguments {
  std::string matte, output;
};

// Declares a verb with its matte and output, for which `run` is called.
CLI::App& add_edit_command(CLI::App& matte, const std::string& name, const std::string& description,
                           const std::string& footer, EditArguments& arguments);
template <typename Arguments>
CLI::App& add_edit_command(CLI::App& matte, CommandLine& command_line, const std::string& name,
                           const std::string& description, const std::string& footer,
                           const std::shared_ptr<Arguments>& arguments,
                           absl::Status (*run)(const CommandLine&, const Arguments&)) {
  CLI::App& command = add_edit_command(matte, name, description, footer, *arguments);
  command.callback([&command_line, arguments, run] {
    command_line.run = [&command_line, arguments, run] { return run(command_line, *arguments); };
  });
  return command;
}

// Reads the matte of an edit; checks for later failures first. INVALID_ARGUMENT: the output's name does not
// end in .exr. NOT_FOUND: its directory does not exist. Errors name the file. Pyramids that an edit drops are
// told (core/matte/pyramid_share.h).
absl::StatusOr<Matte> read_for_edit(const EditArguments& arguments, Pyramids pyramids = Pyramids::kDropped);
absl::StatusOr<Matte> read_for_edit(const std::string& file, Pyramids pyramids = Pyramids::kDropped);
absl::Status check_edit_output(const std::string& output);

// Whether an edit creates digits below the errors, which are then dropped (core/matte/matte_rounding.h).
enum class Digits { kAsTheyAre, kNew };

// Reports a written matte: "OUT: 640x480" and `words` after it, or as JSON with the members of `figures`.
void print_edited(const CommandLine& command_line, const std::string& output, int width_px, int height_px,
                  const std::string& words, const nlohmann::ordered_json& figures);

// Writes the matte, with `edit` added to its list of edits ("crop 640x480+10+20"), and reports it.
absl::Status write_edited(const CommandLine& command_line, const std::string& output, Matte matte,
                          const std::string& edit, Digits digits, const std::string& words,
                          const nlohmann::ordered_json& figures);
absl::Status write_edited(const CommandLine& command_line, const std::string& output, Matte matte,
                          const std::string& edit, Digits digits = Digits::kAsTheyAre);

}  // namespace glasswing
