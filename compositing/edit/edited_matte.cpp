#include "compositing/edit/edited_matte.h"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/mapped_file.h"
#include "core/matte/matte_rounding.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {

CLI::App& add_edit_command(CLI::App& matte, const std::string& name, const std::string& description,
                           const std::string& footer, EditArguments& arguments) {
  CLI::App& command = *matte.add_subcommand(name, description);
  command.footer(footer);
  command.add_option("matte", arguments.matte, "a matte from glasswing fetch, or of an earlier edit")
      ->required();
  command.add_option("-o,--output", arguments.output, "the matte to write (.exr), or - for standard output")
      ->required();
  return command;
}

absl::Status check_edit_output(const std::string& output) {
  return check_output_file(output, {".exr", kStandardOutput});
}

absl::StatusOr<Matte> read_for_edit(const EditArguments& arguments, Pyramids pyramids) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  return read_for_edit(arguments.matte, pyramids);
}

absl::StatusOr<Matte> read_for_edit(const std::string& file, Pyramids pyramids) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> mapped, MappedFile::open(file));
  absl::StatusOr<Matte> matte = decode_matte(mapped->bytes(), Pyramids::kKept);
  if (!matte.ok()) return in_file(file, matte.status());
  if (pyramids == Pyramids::kDropped) {
    tell_lost(pyramid_share(*matte), "matte edits other than crop, flip and join");
    matte->drop_pyramids();
  }
  return matte;
}

void print_edited(const CommandLine& command_line, const std::string& output, int width_px, int height_px,
                  const std::string& words, const nlohmann::ordered_json& figures) {
  if (command_line.json) {
    nlohmann::ordered_json written = {{"file", output}, {"width_px", width_px}, {"height_px", height_px}};
    written.update(figures);
    std::cout << written.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {}x{}{}\n", output, width_px, height_px, words);
  }
}

absl::Status write_edited(const CommandLine& command_line, const std::string& output, Matte matte,
                          const std::string& edit, Digits digits, const std::string& words,
                          const nlohmann::ordered_json& figures) {
  if (digits == Digits::kNew) round_to_errors(matte);
  matte.metadata.add_edits(edit);
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  GW_RETURN_IF_ERROR(write_output(output, bytes));
  print_edited(command_line, output, matte.width_px(), matte.height_px(), words, figures);
  return absl::OkStatus();
}

absl::Status write_edited(const CommandLine& command_line, const std::string& output, Matte matte,
                          const std::string& edit, Digits digits) {
  return write_edited(command_line, output, std::move(matte), edit, digits, "",
                      nlohmann::ordered_json::object());
}

}  // namespace glasswing
