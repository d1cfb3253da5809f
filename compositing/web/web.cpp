#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "compositing/composite/composite_rays.h"
#include "compositing/picture/picture.h"
#include "compositing/view/sampled_matte.h"
#include "compositing/web/commands.h"
#include "core/base/status.h"
#include "core/cli/output_file.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/image/image_file.h"
#include "core/image/radiance_hdr.h"
#include "core/matte/matte_region.h"
#include "core/rays/ray_file.h"
#include "core/web/web_description.h"
#include "core/web/web_matte.h"
#include "core/web/web_rays.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDescription = "matte.json";
constexpr const char* kPlanes = "matte.bin";

struct WebArguments {
  std::string matte, output, title, player;
  std::vector<std::string> backgrounds, environments;
  double environment_turn_deg = 0.0, environment_gain = 1.0;
  bool lossless = false;
  double megapixels = 2.0;

  std::int64_t max_pixels() const { return static_cast<std::int64_t>(1e6 * megapixels); }
};

// What the folder shows: a matte, or rays as a matte in front of the faces of a cube.
struct Shown {
  Matte matte;
  int step = 1;                    // of so many pixels along either side one is in it
  std::optional<double> view_deg;  // of rays: the angle that the camera sees across
};

// Beside the programs, built or installed.
fs::path default_player() {
  std::error_code error;
  const fs::path root = fs::read_symlink("/proc/self/exe", error).parent_path().parent_path();
  const fs::path installed = root / "share/glasswing/web-player";
  return fs::exists(installed) ? installed : root / "web-player";
}

absl::Status check_pictures(const WebArguments& arguments, bool rays) {
  if (rays && !arguments.backgrounds.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{} contains rays, which need --environment instead of --background", arguments.matte));
  }
  if (!rays && (arguments.lossless || !arguments.environments.empty())) {
    return absl::InvalidArgumentError(
        fmt::format("{} is for rays; {} is not a rays file: glasswing rays makes one from mattes at two "
                    "depths",
                    arguments.lossless ? "--lossless" : "--environment", arguments.matte));
  }
  return absl::OkStatus();
}

absl::StatusOr<Shown> shown_rays(const WebArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const RayMatte rays, read_rays(arguments.matte));
  const int step = sampling_step(rays.width_px(), rays.height_px(), arguments.max_pixels());
  return Shown{.matte = web_matte_of(rays, step, arguments.lossless),
               .step = step,
               .view_deg = view_deg(rays.metadata.geometry().camera())};
}

absl::StatusOr<Shown> shown_matte(const WebArguments& arguments) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(arguments.matte));
  absl::StatusOr<SampledMatte> sampled = sample_matte(file->bytes(), arguments.max_pixels());
  if (!sampled.ok()) return in_file(arguments.matte, sampled.status());
  return Shown{.matte = std::move(sampled->matte), .step = sampled->step, .view_deg = std::nullopt};
}

nlohmann::ordered_json description_of(const WebArguments& arguments, const Shown& shown, const WebMatte& web,
                                      const std::vector<std::string>& pictures) {
  const v1::MatteMetadata& metadata = shown.matte.metadata;
  nlohmann::ordered_json description =
      describe_web_matte(arguments.title, metadata, shown.step * std::max(metadata.sampling_px(), 1), web);
  if (shown.view_deg) {
    description["environments"] = pictures;
    description["turn_deg"] = arguments.environment_turn_deg;
    description["gain"] = arguments.environment_gain;
    description["view_deg"] = *shown.view_deg;
  } else {
    description["backgrounds"] = pictures;
  }
  return description;
}

bool is_shown_by_browsers(const fs::path& picture) {
  constexpr std::array<const char*, 5> kShown{".png", ".jpg", ".jpeg", ".webp", ".avif"};
  return std::ranges::find(kShown, picture.extension().string()) != kShown.end();
}

// A picture as stored in the folder: Radiance's .hdr for an environment in a format that browsers do not
// support.
struct OfferedPicture {
  fs::path name;
  std::string bytes;
};
absl::StatusOr<OfferedPicture> offered_background(const fs::path& picture) {
  if (!is_shown_by_browsers(picture)) {
    return absl::InvalidArgumentError(fmt::format(
        "the background is {}; browsers show .png, .jpg, .jpeg, .webp and .avif", picture.string()));
  }
  GW_ASSIGN_OR_RETURN(std::string bytes, read_file(picture));
  return OfferedPicture{picture.filename(), std::move(bytes)};
}
absl::StatusOr<OfferedPicture> offered_environment(const fs::path& picture) {
  if (is_shown_by_browsers(picture)) return offered_background(picture);
  constexpr int kMaxWidth = 4096;
  GW_ASSIGN_OR_RETURN(const RadianceImage light, read_radiance(picture, Encoding::kDisplay));
  const int width = std::min(light.width_px, kMaxWidth);
  const int height = std::max(1, static_cast<int>(std::int64_t{light.height_px} * width / light.width_px));
  return OfferedPicture{picture.stem().string() + ".hdr", encode_hdr(resized(light, width, height))};
}

// Names within the folder: the pictures' own if they are distinct.
absl::StatusOr<std::vector<std::string>> copy_pictures(const WebArguments& arguments,
                                                       const fs::path& folder) {
  std::vector<std::string> names;
  std::set<std::string> taken{kDescription, kPlanes, "index.html"};
  const auto copy = [&](const OfferedPicture& picture) {
    std::string name = picture.name.string();
    while (!taken.insert(name).second) name = "_" + name;
    names.push_back(name);
    return write_file_flushed(folder / name, picture.bytes);
  };
  for (const std::string& picture : arguments.backgrounds) {
    GW_ASSIGN_OR_RETURN(const OfferedPicture offered, offered_background(picture));
    GW_RETURN_IF_ERROR(copy(offered));
  }
  for (const std::string& picture : arguments.environments) {
    GW_ASSIGN_OR_RETURN(const OfferedPicture offered, offered_environment(picture));
    GW_RETURN_IF_ERROR(copy(offered));
  }
  return names;
}

absl::Status copy_player(const fs::path& player, const fs::path& folder) {
  if (!fs::exists(player / "index.html")) {
    return absl::NotFoundError(
        fmt::format("the player is not in {}; deploy/build builds it, and --player names another directory",
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

absl::Status write_web_folder(const CommandLine& command_line, WebArguments arguments) {
  const fs::path folder = arguments.output;
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_empty(folder, ignored) &&
      !fs::exists(folder / kDescription, ignored)) {
    return absl::InvalidArgumentError(fmt::format(
        "the output is {}, which has other files; it must be new, empty, or an earlier web folder",
        folder.string()));
  }
  const bool rays = holds_rays(arguments.matte);
  GW_RETURN_IF_ERROR(check_pictures(arguments, rays));
  GW_ASSIGN_OR_RETURN(const Shown shown, rays ? shown_rays(arguments) : shown_matte(arguments));
  GW_ASSIGN_OR_RETURN(const WebMatte web, encode_web_matte(shown.matte));
  if (arguments.title.empty()) arguments.title = shown.matte.metadata.session();
  GW_RETURN_IF_ERROR(make_directory_durably(folder));
  fs::remove(folder / kDescription, ignored);  // the folder is whole once it is there again
  fs::remove_all(folder / "assets", ignored);
  GW_RETURN_IF_ERROR(
      copy_player(arguments.player.empty() ? default_player() : fs::path(arguments.player), folder));
  GW_ASSIGN_OR_RETURN(const std::vector<std::string> pictures, copy_pictures(arguments, folder));
  GW_RETURN_IF_ERROR(write_file_flushed(folder / kPlanes, web.bytes));
  GW_RETURN_IF_ERROR(write_file_durably(folder / kDescription,
                                        description_of(arguments, shown, web, pictures).dump(1) + "\n"));
  const std::uintmax_t bytes = size_of(folder);
  if (command_line.json) {
    const nlohmann::ordered_json written = {
        {"folder", folder.string()},         {"bytes", bytes},
        {"matte_bytes", web.bytes.size()},   {"width_px", web.region.width_px},
        {"height_px", web.region.height_px}, {"sampling_px", shown.step}};
    std::cout << written.dump(1) << "\n";
    return absl::OkStatus();
  }
  std::cout << fmt::format("{}: {}x{}, {:.1f} MB, {:.1f} of them the matte\n", folder.string(),
                           web.region.width_px, web.region.height_px, static_cast<double>(bytes) / 1e6,
                           static_cast<double>(web.bytes.size()) / 1e6);
  if (shown.step > 1)
    std::cout << fmt::format("it contains one pixel of {0} x {0}; --megapixels allows more\n", shown.step);
  std::cout << fmt::format("to view it here: python3 -m http.server --directory {}\n", folder.string());
  return absl::OkStatus();
}

}  // namespace

void add_web_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command = *app.add_subcommand(
      "web",
      "Write a folder that any web server can serve: the object in front of any picture, without a "
      "rig.");
  command.footer(
      "Visitors drag and scale the picture behind the object, or drop their own; nothing is uploaded. "
      "Of rays\n"
      "(glasswing rays) the folder shows the object in an environment, which visitors can turn. Another "
      "page\n"
      "embeds the folder with one line: <iframe src=\"vase-web/\" width=\"640\" height=\"480\"></iframe>\n"
      "Its matte contains only what is visible (docs/web.md), a few bytes per pixel.\n\n"
      "Examples:\n"
      "  glasswing web vase.exr -o vase-web\n"
      "  glasswing web vase.exr -o vase-web --title 'A vase of 1910' --background street.jpg --background "
      "sea.jpg\n"
      "  glasswing web rays.exr -o vase-web --environment street.exr --environment sky.hdr\n"
      "  glasswing web rays.exr -o vase-web --environment street.exr --environment-turn 30 "
      "--environment-gain 0.5");
  auto arguments = std::make_shared<WebArguments>();
  command.add_option("matte", arguments->matte, "a matte from glasswing fetch, or a rays file")->required();
  command.add_option("-o,--output", arguments->output, "the folder to write")
      ->required()
      ->check(output_directory());
  command.add_option("--background", arguments->backgrounds,
                     "a picture to offer behind the object, the first is shown initially; may be repeated");
  command.add_option(
      "--environment", arguments->environments,
      "for rays: an environment to offer, equirectangular; the first is shown initially; may be repeated");
  command
      .add_option(
          "--environment-turn", arguments->environment_turn_deg,
          "initial turn of the environment about the vertical, degrees; the view ahead moves to the right")
      ->check(CLI::Range(-3600.0, 3600.0))
      ->capture_default_str();
  command
      .add_option("--environment-gain", arguments->environment_gain,
                  "initial factor on the environment's light")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command.add_flag(
      "--lossless", arguments->lossless,
      "for rays: the object absorbs nothing: light that no monitor showed is taken from the environment's "
      "mean");
  command.add_option("--title", arguments->title, "of the page; default: the session's name");
  command
      .add_option("--megapixels", arguments->megapixels,
                  "leave out rows and columns of mattes larger than this")
      ->check(CLI::Range(0.01, 64.0))
      ->capture_default_str();
  command.add_option("--player", arguments->player,
                     "directory with the built player; default: the installed one");
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return write_web_folder(command_line, *arguments); };
  });
}

}  // namespace glasswing
