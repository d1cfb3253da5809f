#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "compositing/deliver/delivery_file.h"
#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/cli/progress.h"
#include "core/file/mapped_file.h"
#include "core/matte/pyramid_share.h"

namespace glasswing {
namespace {

struct DeliverArguments : EditArguments {
  DeliveryOptions options;
};

std::string text_of(const ExrWindow& window) {
  return fmt::format("{}x{}+{}+{}", window.width_px, window.height_px, window.x0_px, window.y0_px);
}

absl::Status deliver(const CommandLine& command_line, const DeliverArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  GW_RETURN_IF_ERROR(in_file(arguments.matte, tell_lost(file->bytes(), "delivery files")));
  UnfinishedFile written(arguments.output);
  absl::StatusOr<Delivery> delivery;
  {
    Progress progress("writing");
    delivery = write_delivery(file->bytes(), arguments.options, written.path(), 0,
                              [&progress](double fraction) { progress.update(fraction); });
  }
  if (!delivery.ok()) return in_file(arguments.matte, delivery.status());
  GW_RETURN_IF_ERROR(written.finish());
  const ExrWindow& window = delivery->window;
  print_edited(
      command_line, arguments.output, window.picture_width_px, window.picture_height_px,
      fmt::format("{}{}; {:.1f} MB, {:.0f} % of {}",
                  arguments.options.hug ? "; pixels " + text_of(window) : "",
                  delivery->half_layers.empty()
                      ? ""
                      : fmt::format("; 16 bits: {}", fmt::join(delivery->half_layers, ", ")),
                  1e-6 * static_cast<double>(delivery->bytes),
                  100.0 * static_cast<double>(delivery->bytes) / static_cast<double>(file->bytes().size()),
                  arguments.matte),
      {{"window", text_of(window)}, {"half_layers", delivery->half_layers}, {"bytes", delivery->bytes}});
  return absl::OkStatus();
}

}  // namespace

void add_matte_deliver_command(CLI::App& matte, CommandLine& command_line) {
  auto arguments = std::make_shared<DeliverArguments>();
  CLI::App& command = add_edit_command(
      matte, command_line, "deliver", "Write a matte file for other programs: small, tiled, described.",
      "The parts and layers are a matte's, and all verbs read the file. Its header describes its colours and "
      "what was left out, and contains a thumbnail. Keep the matte itself: the server does not accept such a "
      "file.\n\n"
      "Examples:\n"
      "  glasswing matte deliver vase.exr --half --hug -o vase_delivery.exr\n"
      "  glasswing matte deliver both.exr --half --ids both_ids.exr -o both_delivery.exr\n"
      "  glasswing matte deliver large.exr --half --tile 128 -o large_delivery.exr",
      arguments, deliver);
  command.add_flag("--half", arguments->options.half,
                   "16 bits where that changes no composite by more than 2^-11 of its light, such as weights "
                   "and foreground; places and widths keep 32");
  command.add_flag("--hug", arguments->options.hug,
                   "keep only the smallest rectangle that holds the object; the display window stays the "
                   "camera's picture");
  command.add_option("--ids", arguments->options.ids,
                     "add which object each pixel shows: a Cryptomatte written by merge --ids");
  command
      .add_option("--tile", arguments->options.tile_px, "write tiles of this side, px; default: scan lines")
      ->check(CLI::Range(kMinTile_px, kMaxTile_px));
}

}  // namespace glasswing
