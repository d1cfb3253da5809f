#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "client/cli/output.h"
#include "client/pictures/commands.h"
#include "client/pictures/sampled_matte.h"
#include "client/pictures/web_matte.h"
#include "core/base/file.h"
#include "core/base/mapped_file.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDescription = "matte.json";
constexpr const char* kPlanes = "matte.bin";

struct WebArguments {
  std::string matte, output, title, player;
  std::vector<std::string> backgrounds;
  double megapixels = 2.0;
};

// Beside the programs, built or installed.
fs::path default_player() {
  std::error_code error;
  const fs::path root = fs::read_symlink("/proc/self/exe", error).parent_path().parent_path();
  const fs::path installed = root / "share/glasswing/web-player";
  return fs::exists(installed) ? installed : root / "web-player";
}

nlohmann::ordered_json description_of(const WebArguments& arguments, const SampledMatte& sampled,
                                      const WebMatte& web, const std::vector<std::string>& backgrounds) {
  const v1::MatteMetadata& metadata = sampled.matte.metadata;
  nlohmann::ordered_json monitors = nlohmann::json::array(), crosstalk = nlohmann::json::array(),
                         planes = nlohmann::json::array();
  for (const v1::Monitor& monitor : metadata.monitors())
    monitors.push_back(
        {{"name", monitor.name()}, {"width_px", monitor.width_px()}, {"height_px", monitor.height_px()}});
  for (const v1::Crosstalk& each : metadata.crosstalk())
    crosstalk.push_back({{"share", std::vector<double>(each.share().begin(), each.share().end())}});
  for (const WebPlane& plane : web.planes) planes.push_back({{"name", plane.name}, {"bytes", plane.bytes}});
  return {{"format", "glasswing-web"},
          {"version", 1},
          {"title", arguments.title},
          {"x_px", web.region.x_px},
          {"y_px", web.region.y_px},
          {"width_px", web.region.width_px},
          {"height_px", web.region.height_px},
          {"metadata",
           {{"monitors", monitors},
            {"crosstalk", crosstalk},
            {"footprint", metadata.footprint()},
            {"sampling_px", sampled.step * std::max(metadata.sampling_px(), 1)}}},
          {"unit_px", web.unit_px},
          {"origin_px", web.origin_px},
          {"foreground_scale", web.foreground_scale},
          {"footprints", web.footprint_count},
          {"planes", planes},
          {"backgrounds", backgrounds}};
}

// Names within the folder, the pictures' own where they differ.
absl::StatusOr<std::vector<std::string>> copy_backgrounds(const std::vector<std::string>& pictures,
                                                          const fs::path& folder) {
  std::vector<std::string> names;
  std::set<std::string> taken{kDescription, kPlanes, "index.html"};
  for (const std::string& picture : pictures) {
    const std::string extension = fs::path(picture).extension().string();
    constexpr std::array<const char*, 5> kShown{".png", ".jpg", ".jpeg", ".webp", ".avif"};
    if (std::ranges::find(kShown, extension) == kShown.end()) {
      return absl::InvalidArgumentError(
          fmt::format("the background is {}; browsers show .png, .jpg, .jpeg, .webp and .avif", picture));
    }
    std::string name = fs::path(picture).filename().string();
    while (!taken.insert(name).second) name = "_" + name;
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(picture));
    GW_RETURN_IF_ERROR(write_file_flushed(folder / name, bytes));
    names.push_back(name);
  }
  return names;
}

absl::Status copy_player(const fs::path& player, const fs::path& folder) {
  if (!fs::exists(player / "index.html")) {
    return absl::NotFoundError(
        fmt::format("the player is not in {}; deploy/build makes it, and --player names another directory",
                    player.string()));
  }
  std::error_code error;
  fs::copy(player, folder, fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(
      fmt::format("cannot copy {} to {}: {}", player.string(), folder.string(), error.message()));
}

std::uintmax_t size_of(const fs::path& folder) {
  std::uintmax_t bytes = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

absl::Status write_web_folder(const Client& client, WebArguments arguments) {
  const fs::path folder = arguments.output;
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_empty(folder, ignored) &&
      !fs::exists(folder / kDescription, ignored)) {
    return absl::InvalidArgumentError(fmt::format(
        "the output is {}, which has other files; it must be new, empty, or an earlier folder for the web",
        folder.string()));
  }
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  const absl::StatusOr<SampledMatte> sampled =
      sample_matte(file->bytes(), static_cast<std::int64_t>(1e6 * arguments.megapixels));
  if (!sampled.ok()) return in_file(arguments.matte, sampled.status());
  GW_ASSIGN_OR_RETURN(const WebMatte web, encode_web_matte(sampled->matte));
  if (arguments.title.empty()) arguments.title = sampled->matte.metadata.session();
  GW_RETURN_IF_ERROR(make_directory_durably(folder));
  fs::remove(folder / kDescription, ignored);  // the folder is whole once it is there again
  fs::remove_all(folder / "assets", ignored);
  GW_RETURN_IF_ERROR(
      copy_player(arguments.player.empty() ? default_player() : fs::path(arguments.player), folder));
  GW_ASSIGN_OR_RETURN(const std::vector<std::string> backgrounds,
                      copy_backgrounds(arguments.backgrounds, folder));
  GW_RETURN_IF_ERROR(write_file_flushed(folder / kPlanes, web.bytes));
  GW_RETURN_IF_ERROR(write_file_durably(
      folder / kDescription, description_of(arguments, *sampled, web, backgrounds).dump(1) + "\n"));
  const std::uintmax_t bytes = size_of(folder);
  if (client.json) {
    const nlohmann::ordered_json written = {
        {"folder", folder.string()},         {"bytes", bytes},
        {"matte_bytes", web.bytes.size()},   {"width_px", web.region.width_px},
        {"height_px", web.region.height_px}, {"sampling_px", sampled->step}};
    std::cout << written.dump(1) << "\n";
    return absl::OkStatus();
  }
  std::cout << fmt::format("{}: {}x{}, {:.1f} MB, {:.1f} of them the matte\n", folder.string(),
                           web.region.width_px, web.region.height_px, static_cast<double>(bytes) / 1e6,
                           static_cast<double>(web.bytes.size()) / 1e6);
  if (sampled->step > 1)
    std::cout << fmt::format("of {0} x {0} pixels one is in it; --megapixels allows more\n", sampled->step);
  std::cout << fmt::format("to look at it here: python3 -m http.server --directory {}\n", folder.string());
  return absl::OkStatus();
}

}  // namespace

void add_web_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "web", "Write a folder that any web server shows: the object in front of any picture, without a rig.");
  command.footer(
      "Visitors drag and scale the picture behind the object, or drop their own; nothing is uploaded. "
      "Another page\n"
      "embeds the folder by one line: <iframe src=\"vase-web/\" width=\"640\" height=\"480\"></iframe>\n"
      "The matte in it has what an eye can see (docs/web.md), a few bytes a pixel.\n\n"
      "Examples:\n"
      "  glasswing web vase.exr -o vase-web\n"
      "  glasswing web vase.exr -o vase-web --title 'A vase of 1910' --background street.jpg --background "
      "sea.jpg");
  auto arguments = std::make_shared<WebArguments>();
  command.add_option("matte", arguments->matte, "a matte that glasswing fetch wrote")->required();
  command.add_option("-o,--output", arguments->output, "the folder to write")->required();
  command.add_option("--background", arguments->backgrounds,
                     "a picture to offer behind the object, the first at once; may be repeated");
  command.add_option("--title", arguments->title, "of the page; default: the session's name");
  command
      .add_option("--megapixels", arguments->megapixels,
                  "leave out rows and columns of mattes larger than this")
      ->check(CLI::Range(0.01, 64.0))
      ->capture_default_str();
  command.add_option("--player", arguments->player,
                     "directory with the built player; default: the installed one");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return write_web_folder(client, *arguments); };
  });
}

}  // namespace glasswing
