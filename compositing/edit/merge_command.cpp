#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <set>
#include <span>

#include "compositing/deliver/cryptomatte.h"
#include "compositing/edit/commands.h"
#include "compositing/edit/edited_matte.h"
#include "compositing/edit/merge.h"
#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

struct MergeArguments {
  std::vector<std::string> mattes;
  std::string output;
  std::string ids;  // a file; empty: none
};

// Puts an object in front of the existing ones.
void add_in_front(const std::string& file, const Matte& front, std::vector<ObjectShares>& objects) {
  ObjectShares& added = *objects.insert(objects.begin(), ObjectShares{front.metadata.session(), {}});
  if (added.name.empty()) added.name = std::filesystem::path(file).stem().string();
  for (int y = 0; y < front.height_px(); ++y) {
    for (int x = 0; x < front.width_px(); ++x) {
      const float alpha = front.coverage(x, y);
      for (ObjectShares& behind : std::span(objects).subspan(1))
        behind.share[added.share.size()] *= 1.0f - alpha;
      added.share.push_back(alpha);
    }
  }
}

// Objects of one session, for example edits of one matte, are named after their files.
void tell_apart(const std::vector<std::string>& files, std::vector<ObjectShares>& objects) {
  std::set<std::string> names;
  for (const ObjectShares& object : objects) names.insert(object.name);
  if (names.size() == objects.size()) return;
  for (size_t i = 0; i < objects.size(); ++i)
    objects[i].name = std::filesystem::path(files[i]).stem().string();
}

absl::Status merge(const CommandLine& command_line, const MergeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  if (!arguments.ids.empty()) GW_RETURN_IF_ERROR(check_output_file(arguments.ids, {".exr"}));
  std::vector<ObjectShares> objects;  // as the mattes
  GW_ASSIGN_OR_RETURN(Matte all, read_for_edit(arguments.mattes.back()));
  if (!arguments.ids.empty()) add_in_front(arguments.mattes.back(), all, objects);
  for (size_t i = arguments.mattes.size() - 1; i-- > 0;) {
    GW_ASSIGN_OR_RETURN(const Matte front, read_for_edit(arguments.mattes[i]));
    absl::StatusOr<Matte> both = merged(front, all);
    if (!both.ok()) return in_file(arguments.mattes[i], both.status());
    all = *std::move(both);
    if (!arguments.ids.empty()) add_in_front(arguments.mattes[i], front, objects);
  }
  if (!arguments.ids.empty()) {
    tell_apart(arguments.mattes, objects);
    GW_ASSIGN_OR_RETURN(const std::string ids, encode_cryptomatte(objects, all.width_px(), all.height_px()));
    GW_RETURN_IF_ERROR(write_file_durably(arguments.ids, ids));
  }
  return write_edited(command_line, arguments.output, std::move(all),
                      fmt::format("merge {}", fmt::join(arguments.mattes, " ")));
}

}  // namespace

void add_matte_merge_command(CLI::App& matte, CommandLine& command_line) {
  CLI::App& command = *matte.add_subcommand("merge", "Put separately captured objects into one matte.");
  command.footer(
      "The first matte is in front; each hides the next as far as it covers a pixel. All must be from one "
      "camera in front of the same monitors. One object is not seen through another: each was captured "
      "alone.\n\n"
      "With --ids a Cryptomatte file records which object each pixel shows, so that compositors can pick one "
      "by name: that of its session, or of its file.\n\n"
      "Examples:\n"
      "  glasswing matte merge vase.exr glass.exr -o both.exr\n"
      "  glasswing matte merge vase.exr glass.exr -o both.exr --ids both_ids.exr");
  auto arguments = std::make_shared<MergeArguments>();
  command.add_option("mattes", arguments->mattes, "two or more mattes, the first in front")
      ->required()
      ->expected(2, 100);
  command.add_option("-o,--output", arguments->output, "the matte to write (.exr), or - for standard output")
      ->required();
  command.add_option("--ids", arguments->ids, "also write a Cryptomatte of the objects (.exr)");
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return merge(command_line, *arguments); };
  });
}

}  // namespace glasswing
