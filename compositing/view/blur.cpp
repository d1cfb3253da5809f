#include "compositing/view/blur.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>

#include "compositing/picture/picture.h"
#include "compositing/view/commands.h"
#include "core/base/median.h"
#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/pattern/pattern.h"

namespace glasswing {
namespace {

constexpr int kGreen = 1;  // channels differ only in the background's weight
constexpr std::array<const char*, 9> kRegions = {
    "top left", "top", "top right", "left", "middle", "right", "bottom left", "bottom", "bottom right"};

// The strongest background mode of a pixel; null if it has none.
const Mode* background_of(const Matte& matte, int x, int y) {
  if (x < 0 || x >= matte.width_px() || y < 0 || y >= matte.height_px()) return nullptr;
  if (matte.coverage(x, y) > 0.0f || matte.flags(x, y) != kFlagNone) return nullptr;
  const std::span<const Mode> modes = matte.modes(x, y, kGreen);
  const Mode& strongest = *std::ranges::max_element(modes, {}, &Mode::weight);
  return strongest.weight > 0.0f ? &strongest : nullptr;
}

struct Slope {
  double x_px, y_px;  // change of the centre on the monitor per camera px
};

// The slope along one axis of the picture, from the neighbours on both sides.
std::optional<Slope> slope_at(const Matte& matte, int x, int y, int dx, int dy) {
  const Mode* before = background_of(matte, x - dx, y - dy);
  const Mode* after = background_of(matte, x + dx, y + dy);
  if (before == nullptr || after == nullptr || before->texture != after->texture) return std::nullopt;
  return Slope{0.5 * static_cast<double>(after->x_px - before->x_px),
               0.5 * static_cast<double>(after->y_px - before->y_px)};
}

struct Part {
  std::vector<double> xx_px2, yy_px2;         // S
  std::array<std::vector<double>, 4> slopes;  // J, row by row

  BlurRegion region() const {
    BlurRegion region{.pixel_count = static_cast<int>(xx_px2.size())};
    if (xx_px2.empty()) return region;
    const double xx = median(xx_px2), yy = median(yy_px2);
    region.monitor_px = {std::sqrt(xx), std::sqrt(yy)};
    if (slopes[0].empty()) return region;
    const double a = median(slopes[0]), b = median(slopes[1]), c = median(slopes[2]), d = median(slopes[3]);
    const double determinant = std::abs(a * d - b * c);
    if (determinant < 1e-6) return region;
    region.camera_px = {std::sqrt(d * d * xx + b * b * yy) / determinant,
                        std::sqrt(c * c * xx + a * a * yy) / determinant};
    return region;
  }
};

void add(const Matte& matte, int x, int y, const Mode& mode, Part& part) {
  part.xx_px2.push_back(static_cast<double>(mode.xx_px2));
  part.yy_px2.push_back(static_cast<double>(mode.yy_px2));
  const std::optional<Slope> right = slope_at(matte, x, y, 1, 0), down = slope_at(matte, x, y, 0, 1);
  if (!right || !down) return;
  for (const auto& [place, slope] : {std::pair(0, right->x_px), std::pair(1, down->x_px),
                                     std::pair(2, right->y_px), std::pair(3, down->y_px)})
    part.slopes[place].push_back(slope);
}

bool all_alike(const std::vector<double>& values) {
  return std::ranges::adjacent_find(values, std::not_equal_to<>()) == values.end();
}

// Linear light, brightness rising with `share`, 0 to 1.
Colour colour_of(double share) {
  constexpr std::array<Colour, 4> kStops = {
      {{0.0f, 0.0f, 0.1f}, {0.2f, 0.0f, 0.3f}, {0.8f, 0.15f, 0.05f}, {1.0f, 0.95f, 0.6f}}};
  const double place = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const auto stop = std::min(static_cast<size_t>(place), kStops.size() - 2);
  const auto part = static_cast<float>(place - static_cast<double>(stop));
  Colour colour{};
  for (size_t c = 0; c < 3; ++c) colour[c] = (1.0f - part) * kStops[stop][c] + part * kStops[stop + 1][c];
  return colour;
}

struct BlurArguments {
  std::string matte;
  std::string output;
};

nlohmann::ordered_json json_of(const BlurRegion& region) {
  const auto pair = [](const std::optional<std::array<double, 2>>& sigma) {
    return sigma ? nlohmann::ordered_json(*sigma) : nlohmann::ordered_json();
  };
  return {{"pixels", region.pixel_count},
          {"sigma_monitor_px", pair(region.monitor_px)},
          {"sigma_camera_px", pair(region.camera_px)}};
}

std::vector<std::string> row_of(const std::string& name, const BlurRegion& region) {
  std::vector<std::string> row = {name, std::to_string(region.pixel_count)};
  for (const auto& sigma : {region.monitor_px, region.camera_px}) {
    for (size_t axis = 0; axis < 2; ++axis)
      row.push_back(sigma ? fmt::format("{:.3f}", (*sigma)[axis]) : "-");
  }
  return row;
}

void print_rows(const CommandLine& command_line, const Blur& found) {
  std::vector<std::vector<std::string>> rows;
  for (size_t i = 0; i < kRegions.size(); ++i) rows.push_back(row_of(kRegions[i], found.regions[i]));
  rows.push_back(row_of("whole", found.whole));
  if (!command_line.tsv) std::cout << "sigma, medians, in pixels of the monitor and of the camera\n";
  print_table(command_line,
              {{"REGION"},
               {"PIXELS", true},
               {"MONITOR_X", true},
               {"MONITOR_Y", true},
               {"CAMERA_X", true},
               {"CAMERA_Y", true}},
              rows);
}

// The width of the brightest colour: a round number above the usual widths.
double max_px_of(const Blur& blur) {
  return std::ceil(3.0 * std::max((*blur.whole.monitor_px)[0], (*blur.whole.monitor_px)[1]));
}

absl::StatusOr<Blur> measured(const BlurArguments& arguments) {
  const Waiting waiting("measuring");
  GW_ASSIGN_OR_RETURN(const Matte matte, read_matte(arguments.matte));
  GW_ASSIGN_OR_RETURN(const Blur found, blur_of(matte));
  if (!arguments.output.empty())
    GW_RETURN_IF_ERROR(
        write_radiance(arguments.output, blur_picture(matte, max_px_of(found)), Encoding::kDisplay));
  return found;
}

absl::Status blur(const CommandLine& command_line, const BlurArguments& arguments) {
  if (!arguments.output.empty()) GW_RETURN_IF_ERROR(check_output(arguments.output));
  GW_ASSIGN_OR_RETURN(const Blur found, measured(arguments));
  const double max_px = max_px_of(found);
  if (command_line.json) {
    nlohmann::ordered_json answer = {{"regions", nlohmann::ordered_json::object()}};
    for (size_t i = 0; i < kRegions.size(); ++i) answer["regions"][kRegions[i]] = json_of(found.regions[i]);
    answer["whole"] = json_of(found.whole);
    if (!arguments.output.empty()) answer["picture"] = {{"file", arguments.output}, {"brightest_px", max_px}};
    std::cout << answer.dump(1) << "\n";
    return absl::OkStatus();
  }
  print_rows(command_line, found);
  if (!arguments.output.empty() && !command_line.tsv)
    std::cout << fmt::format("{}: the larger sigma, 0 (left of the bar) to {:g} monitor px (right)\n",
                             arguments.output, max_px);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Blur> blur_of(const Matte& matte) {
  std::array<Part, 9> parts;
  Part whole;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      const Mode* mode = background_of(matte, x, y);
      if (mode == nullptr) continue;
      add(matte, x, y, *mode, whole);
      add(matte, x, y, *mode, parts[3 * (3 * y / matte.height_px()) + 3 * x / matte.width_px()]);
    }
  }
  if (whole.xx_px2.empty()) {
    return absl::InvalidArgumentError(
        "the matte has no pixel outside the silhouette that sees a monitor; the blur is measured there, best "
        "with nothing on the stage");
  }
  // Without a measurement, every pixel has the same nominal width.
  if (whole.xx_px2.size() > 1 && (all_alike(whole.xx_px2) || all_alike(whole.yy_px2))) {
    return absl::InvalidArgumentError(
        "the matte's background was not measured: its session had no square waves without the object "
        "(square_waves in the plan)");
  }
  Blur blur{.regions = {}, .whole = whole.region()};
  std::ranges::transform(parts, blur.regions.begin(), &Part::region);
  return blur;
}

RadianceImage blur_picture(const Matte& matte, double max_px) {
  constexpr Colour kNothing{0.05f, 0.05f, 0.05f};
  const int bar_px = std::max(matte.height_px() / 16, 4), gap_px = bar_px / 2;
  RadianceImage picture(matte.width_px(), matte.height_px() + gap_px + bar_px);
  const auto paint = [&](int x, int y, const Colour& colour) {
    for (int c = 0; c < 3; ++c) picture.at(x, y, c) = colour[c];
  };
  for (int x = 0; x < picture.width_px; ++x) {
    for (int y = 0; y < picture.height_px; ++y) paint(x, y, kNothing);
    for (int y = 0; y < matte.height_px(); ++y) {
      if (const Mode* mode = background_of(matte, x, y)) {
        const double larger_px2 = std::max(mode->xx_px2, mode->yy_px2);
        paint(x, y, colour_of(std::sqrt(larger_px2) / max_px));
      }
    }
    for (int y = matte.height_px() + gap_px; y < picture.height_px; ++y)
      paint(x, y, colour_of(static_cast<double>(x) / std::max(picture.width_px - 1, 1)));
  }
  return picture;
}

void add_blur_command(CLI::App& app, CommandLine& command_line) {
  CLI::App& command =
      *app.add_subcommand("blur", "Measure the blur of camera and monitor over the picture, from a matte.");
  command.footer(
      "The blur combines lens, monitor and camera pixel, as a standard deviation. It is measured\n"
      "outside the silhouette, best with an empty stage.\n\n"
      "Example:\n"
      "  glasswing capture deploy/plans/blur.txtpb --session blur --watch\n"
      "  glasswing solve blur --watch\n"
      "  glasswing fetch blur -o blur.exr\n"
      "  glasswing blur blur.exr -o blur.png");
  auto arguments = std::make_shared<BlurArguments>();
  command.add_option("matte", arguments->matte, "a matte from glasswing fetch")->required();
  command.add_option("-o,--output", arguments->output, "a map of the widths to write: .png, .exr or .tif");
  command.callback([&command_line, arguments] {
    command_line.run = [&command_line, arguments] { return blur(command_line, *arguments); };
  });
}

}  // namespace glasswing
