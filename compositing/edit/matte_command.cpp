#include "compositing/edit/commands.h"

namespace glasswing {

void add_matte_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& matte = *app.add_subcommand(
      "matte",
      "Edit mattes: crop, resize, flip, grade, merge, join or fill them; deliver them to other programs.");
  matte.require_subcommand(1);
  matte.footer(
      "Compositing the edited matte gives the edited composite. The file records its edits.\n\n"
      "Examples:\n"
      "  glasswing matte resize vase.exr 1920x1080 -o vase_hd.exr\n"
      "  glasswing matte merge vase.exr glass.exr -o both.exr\n"
      "  glasswing matte deliver vase.exr --half --hug -o vase_delivery.exr");
  add_matte_crop_command(matte, command_line);
  add_matte_resize_command(matte, command_line);
  add_matte_flip_command(matte, command_line);
  add_matte_grade_command(matte, command_line);
  add_matte_merge_command(matte, command_line);
  add_matte_join_command(matte, command_line);
  add_matte_fill_command(matte, command_line);
  add_matte_deliver_command(matte, command_line);
}

}  // namespace glasswing
