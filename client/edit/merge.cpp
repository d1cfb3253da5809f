#include "core/edit/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "client/edit/commands.h"
#include "client/edit/edited_matte.h"
#include "client/pictures/picture.h"
#include "core/base/status.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

struct MergeArguments {
  std::vector<std::string> mattes;
  std::string output;
};

absl::Status merge(const Client& client, const MergeArguments& arguments) {
  GW_RETURN_IF_ERROR(check_edit_output(arguments.output));
  GW_ASSIGN_OR_RETURN(Matte all, read_matte(arguments.mattes.back()));
  for (size_t i = arguments.mattes.size() - 1; i-- > 0;) {
    GW_ASSIGN_OR_RETURN(const Matte front, read_matte(arguments.mattes[i]));
    absl::StatusOr<Matte> both = merged(front, all);
    if (!both.ok()) return in_file(arguments.mattes[i], both.status());
    all = *std::move(both);
  }
  return write_edited(client, arguments.output, std::move(all),
                      fmt::format("merge {}", fmt::join(arguments.mattes, " ")));
}

}  // namespace

void add_matte_merge_command(CLI::App& matte, Client& client) {
  CLI::App& command = *matte.add_subcommand("merge", "Put objects that were captured apart into one matte.");
  command.footer(
      "The first matte is in front; each hides the next as far as it covers a pixel. All must be of one "
      "camera before the same monitors. One object is not seen through another: each was captured alone.\n\n"
      "Examples:\n"
      "  glasswing matte merge vase.exr glass.exr -o both.exr");
  auto arguments = std::make_shared<MergeArguments>();
  command.add_option("mattes", arguments->mattes, "two or more mattes, the first in front")
      ->required()
      ->expected(2, 100);
  command.add_option("-o,--output", arguments->output, "the matte to write (.exr)")->required();
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return merge(client, *arguments); }; });
}

}  // namespace glasswing
