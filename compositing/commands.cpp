#include "compositing/commands.h"

#include "compositing/composite/commands.h"
#include "compositing/dataset/commands.h"
#include "compositing/edit/commands.h"
#include "compositing/hosts/nuke/commands.h"
#include "compositing/picture/commands.h"
#include "compositing/picture/picture.h"
#include "compositing/stmap/commands.h"
#include "compositing/view/commands.h"
#include "compositing/web/commands.h"
#include "core/base/status.h"
#include "core/cli/completion.h"
#include "core/cli/man_page.h"
#include "core/file/mapped_file.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr const char* kMore = R"(.SH EXIT STATUS
.TP
0
Success.
.TP
1
Failure; one line on standard error says why.
.TP
2
The command line or the configuration file is wrong.
.TP
130
Interrupted with Ctrl\-C.
.SH FILES
.TP
.I ~/.config/glasswing/config.toml
The setting color, as \fBcolor\fR = \fB"auto"\fR.
.SH ENVIRONMENT
.TP
.B GLASSWING_CONFIG
The configuration file to read instead.
.TP
.B NO_COLOR
Disables colours, unless \-\-color is always.
)";

absl::StatusOr<Matte> read_matte_file(const std::string& name, const std::filesystem::path&,
                                      Pyramids pyramids) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(name));
  absl::StatusOr<Matte> matte = decode_matte(file->bytes(), pyramids);
  if (!matte.ok()) return in_file(name, matte.status());
  return matte;
}

}  // namespace

void add_matte_commands(CLI::App& app, CommandLine& command_line, ReadMatte read) {
  add_composite_command(app, command_line);
  add_matte_command(app, command_line);
  add_rays_command(app, command_line, read);
  add_dataset_command(app, command_line, std::move(read));
  add_stmap_command(app, command_line);
  add_nuke_command(app, command_line);
  add_view_command(app, command_line);
  add_web_command(app, command_line);
}

void add_picture_commands(CLI::App& app, CommandLine& command_line) {
  add_sheet_command(app, command_line);
  add_compare_command(app, command_line);
  add_blur_command(app, command_line);
  add_convert_command(app, command_line);
}

int run_compositing(int argc, const char* const* argv) {
  CommandLine command_line;
  const auto add = [&](CLI::App& app, const Config&) {
    app.group("Mattes");
    add_matte_commands(app, command_line, &read_matte_file);
    app.group("Pictures");
    add_picture_commands(app, command_line);
    app.group("This program");
    add_completion_commands(app, command_line, nullptr);
    add_man_pages_command(app, command_line, kMore);
  };
  return run_command_line(
      argc, argv,
      {.name = "glasswing-compositing",
       .description = "Composites captured objects over pictures, and edits, shows and delivers "
                      "their mattes. The verbs are those of glasswing that need no rig.",
       .footer = "Examples:\n"
                 "  glasswing-compositing composite vase.exr --background harbour.png -o vase.png\n"
                 "  glasswing-compositing view vase.exr -o sheet.png",
       .settings = {},
       .add_commands = add},
      command_line);
}

}  // namespace glasswing
