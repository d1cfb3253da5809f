#include <fmt/format.h>

#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "compositing/edit/reshape.h"
#include "compositing/picture/picture.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/file/mapped_file.h"

namespace glasswing {
namespace {

struct ReshapeArguments : EditArguments {
  std::string to;  // a region, a size or an axis
  int max_modes = kMaxModes;
};

absl::Status crop(const CommandLine& command_line, const ReshapeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  GW_ASSIGN_OR_RETURN(const MatteRegion region, parse_region(arguments.to));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  absl::StatusOr<Matte> part = crop_matte(file->bytes(), region);
  if (!part.ok()) return in_file(arguments.matte, part.status());
  return write_edited(command_line, arguments.output, *std::move(part), "crop " + arguments.to);
}

struct Size {
  int width_px = 0, height_px = 0;
};
absl::StatusOr<Size> parse_size(const std::string& text) {
  Size size;
  if (Scanner(text).number(size.width_px).then("x").number(size.height_px).done()) return size;
  return absl::InvalidArgumentError(
      fmt::format("the size is \"{}\"; it must be WIDTHxHEIGHT, such as 1920x1080", text));
}

absl::Status resize(const CommandLine& command_line, const ReshapeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Size size, parse_size(arguments.to));
  GW_ASSIGN_OR_RETURN(const Matte matte, read_for_edit(arguments));
  absl::StatusOr<Matte> out = resized(matte, size.width_px, size.height_px, arguments.max_modes);
  if (!out.ok()) return in_file(arguments.matte, out.status());
  return write_edited(command_line, arguments.output, *std::move(out), "resize " + arguments.to,
                      Digits::kNew);
}

absl::Status flip(const CommandLine& command_line, const ReshapeArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const Matte matte, read_for_edit(arguments, Pyramids::kKept));
  return write_edited(command_line, arguments.output, flipped(matte, arguments.to == "y"),
                      "flip " + arguments.to);
}

}  // namespace

void add_matte_crop_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<ReshapeArguments>();
  add_edit_command(matte, command_line, "crop", "Write a region of a matte.",
                   "Examples:\n"
                   "  glasswing matte crop vase.exr 640x480+100+50 -o part.exr",
                   arguments, crop)
      .add_option("region", arguments->to,
                  "WIDTHxHEIGHT+X+Y: px of the camera's picture, from its top-left corner")
      ->required();
}

void add_matte_resize_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<ReshapeArguments>();
  CLI::App& command = add_edit_command(
      matte, command_line, "resize", "Resize a matte by area, like a picture.",
      "A pixel keeps the modes of all pixels that it combines; if there are more than --modes, the most "
      "similar ones are merged. The errors of its composites are no longer known, those of its modes are.\n\n"
      "Examples:\n"
      "  glasswing matte resize vase.exr 960x540 -o half.exr",
      arguments, resize);
  command.add_option("size", arguments->to, "WIDTHxHEIGHT of the result, px")->required();
  command.add_option("--modes", arguments->max_modes, "maximum modes per pixel and channel")
      ->check(CLI::Range(1, kMaxModes))
      ->capture_default_str();
}

void add_matte_flip_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<ReshapeArguments>();
  add_edit_command(matte, command_line, "flip",
                   "Exchange left and right of the camera's picture, or top and bottom.",
                   "The monitors are not changed.\n\n"
                   "Examples:\n"
                   "  glasswing matte flip vase.exr x -o mirrored.exr",
                   arguments, flip)
      .add_option("axis", arguments->to, "x: left and right are exchanged, y: top and bottom")
      ->required()
      ->check(CLI::IsMember({"x", "y"}));
}

}  // namespace glasswing
