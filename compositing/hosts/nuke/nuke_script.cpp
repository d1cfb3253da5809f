#include "compositing/hosts/nuke/nuke_script.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "core/matte/covariance_axes.h"
#include "core/matte/matte_file.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

constexpr int kBands = 3;
// Pixels of the band before, or of the monitor, to one of a band and back; odd, so that a pixel's middle is
// that of a pixel of the other size.
constexpr int kEnlarged = 3;
constexpr std::array<int, kBands> kReduced{1, 3, 9};
// The steps of each band's blurs in its pixels: a variance about doubles, and a step is at most twice the
// standard deviation that is there. Each band above the first begins at three pixels, so that the nearest is
// near enough; the last ends at 286 px of the monitor.
const std::array<std::vector<int>, kBands> kSteps{
    {{1, 1, 2, 2, 4, 4, 8, 8}, {4, 6, 8, 11, 16, 22, 32}, {4, 6, 8, 11, 16, 22, 32}}};
constexpr double kMaxSpread = 3.0;  // of the taps, in standard deviations of what each of them sees

// Places in standard deviations and weights of the taps; their variance is 1.
struct Tap {
  int place;
  double weight;
};
constexpr std::array<Tap, 5> kTaps{{{0, 0.382962820238683},
                                    {-1, 0.244691453174211},
                                    {1, 0.244691453174211},
                                    {-2, 0.063827136706447},
                                    {2, 0.063827136706447}}};

// What a monitor's modes need is left out below this mean square (60 dB below full scale).
constexpr double kNegligible = 1e-6;
// Mean square of what a wrong width does to a picture's pixel.
constexpr double kContrast = 0.01;

constexpr std::array<const char*, kChannels> kColours{"red", "green", "blue"};

// The variances of a band's levels, px^2 of the monitor; the first is the last of the band before.
using Band = std::vector<double>;

std::vector<Band> ladder() {
  std::vector<Band> bands;
  double variance_px2 = 0.0, pixel_px = 1.0 / kEnlarged;
  for (size_t b = 0; b < kBands; ++b) {
    pixel_px *= kReduced[b];
    bands.push_back({variance_px2});
    for (const int step : kSteps[b])
      bands.back().push_back(variance_px2 += 0.5 * std::pow(step * pixel_px, 2));  // of 1 2 1
  }
  return bands;
}

// What the modes of one place in the list, in one channel and on one monitor, need of a ladder.
struct Need {
  double light = 0.0;                    // sum of weights
  std::array<double, kBands> reached{};  // sums of squared weights by the band of the width
  std::array<double, kBands> longish{};  // the same, of what a round footprint would do wrong
  void add(const Need& other) {
    light += other.light;
    for (size_t b = 0; b < kBands; ++b) {
      reached[b] += other.reached[b];
      longish[b] += other.longish[b];
    }
  }
};

void count(const Mode& mode, const std::vector<Band>& bands, Need& need) {
  if (!(mode.weight > 0.0f)) return;
  need.light += static_cast<double>(mode.weight);
  const auto [wide, narrow] = axis_variances({.xx = mode.xx_px2, .xy = mode.xy_px2, .yy = mode.yy_px2});
  const double round = std::max(narrow, wide / (1 + kMaxSpread * kMaxSpread));
  size_t band = 0;
  while (band + 1 < kBands && round > bands[band].back()) ++band;
  const double square = std::pow(static_cast<double>(mode.weight), 2);
  need.reached[band] += square;
  need.longish[band] += square * std::pow((wide - narrow) / (wide + 0.1), 2);
}

// By mode, channel (only the first of a colourless matte) and monitor.
struct Needs {
  explicit Needs(const MatteOutline& outline)
      : channels(outline.colourless ? 1 : kChannels),
        monitors(static_cast<size_t>(outline.metadata.monitors_size())),
        all(static_cast<size_t>(outline.modes_per_channel) * channels * monitors) {}
  Need& at(int mode, int channel, int monitor) {
    return all[(static_cast<size_t>(mode) * channels + channel) * monitors + static_cast<size_t>(monitor)];
  }
  const size_t channels, monitors;
  std::vector<Need> all;
};

absl::StatusOr<Needs> needs_of(std::string_view matte, const MatteOutline& outline,
                               const std::vector<Band>& bands) {
  Needs needs(outline);
  std::mutex mutex;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(matte, 0, [&](const Matte& rows) {
    Needs here(outline);
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) {
        if (rows.flags(x, y) & kFlagNoData) continue;
        for (int c = 0; c < static_cast<int>(here.channels); ++c) {
          const std::span<const Mode> modes = rows.modes(x, y, c);
          for (size_t i = 0; i < modes.size(); ++i) {
            if (modes[i].texture >= 0 && modes[i].texture < static_cast<int>(here.monitors))
              count(modes[i], bands, here.at(static_cast<int>(i), c, modes[i].texture));
          }
        }
      }
    }
    const std::lock_guard lock(mutex);
    for (size_t i = 0; i < needs.all.size(); ++i) needs.all[i].add(here.all[i]);
    return absl::OkStatus();
  }));
  return needs;
}

// How many taps of each band show a mode; none of bands that its widths do not reach.
std::array<int, kBands> taps_for(const Need& need, double pixels) {
  std::array<int, kBands> taps{};
  const double least = kNegligible / kContrast * pixels;
  double reached = 0.0, longish = 0.0;
  for (size_t b = kBands; b-- > 0;) {
    reached += need.reached[b];
    longish += need.longish[b];
    taps[b] = longish > least ? static_cast<int>(kTaps.size()) : reached > least || b == 0 ? 1 : 0;
  }
  return taps;
}

// Nodes in the order of a script. Each is kept by name, since a node takes its inputs from a stack, the first
// on top.
class Nodes {
 public:
  using Id = int;
  static constexpr Id kNone = 0;

  Id add(const std::string& type, const std::string& name, const std::vector<Id>& inputs,
         const std::string& knobs) {
    for (auto input = inputs.rbegin(); input != inputs.rend(); ++input)
      text += *input == kNone ? "push 0\n" : fmt::format("push $N{}\n", *input);
    text += fmt::format("{} {{\n inputs {}\n{} name {}\n xpos {}\n ypos {}\n}}\nset N{} [stack 0]\n", type,
                        inputs.size(), knobs, name, column_ * 110, row_++ * 40, ++last_);
    return last_;
  }
  // Where the next nodes are drawn.
  void begin_column() {
    ++column_;
    row_ = 0;
  }

  std::string text;
  int count() const { return last_; }

 private:
  int column_ = 0, row_ = 0;
  Id last_ = 0;
};

using Id = Nodes::Id;

Id add_expression(Nodes& nodes, const std::string& type, const std::string& name,
                  const std::vector<Id>& inputs, const std::array<std::string, 4>& values,
                  const std::vector<std::pair<std::string, std::string>>& variables = {}) {
  std::string knobs;
  for (size_t i = 0; i < variables.size(); ++i)
    knobs +=
        fmt::format(" temp_name{0} {1}\n temp_expr{0} \"{2}\"\n", i, variables[i].first, variables[i].second);
  for (size_t i = 0; i < values.size(); ++i) knobs += fmt::format(" expr{} \"{}\"\n", i, values[i]);
  return nodes.add(type, name, inputs, knobs);
}

Id add_reformat(Nodes& nodes, const std::string& name, Id input, int width, int height,
                const std::string& resize) {
  return nodes.add(
      "Reformat", name, {input},
      fmt::format(" type \"to box\"\n box_width {}\n box_height {}\n box_fixed true\n resize {}\n", width,
                  height, resize));
}

Id add_move(Nodes& nodes, const std::string& name, Id input, int x, int y) {
  return nodes.add(
      "Transform", name, {input},
      fmt::format(" translate {{{} {}}}\n center {{0 0}}\n filter Impulse\n black_outside true\n", x, y));
}

Id add_merge(Nodes& nodes, const std::string& name, const std::string& operation, Id b, Id a) {
  return nodes.add("Merge2", name, {b, a}, fmt::format(" operation {}\n", operation));
}

// 1 2 1 in x and in y, each the average of two averages.
Id add_blur(Nodes& nodes, const std::string& name, Id input, int step) {
  for (const auto& [x, y] : {std::pair{step, 0}, {-step, 0}, {0, step}, {0, -step}}) {
    const std::string way = y == 0 ? (x > 0 ? "right" : "left") : (y > 0 ? "up" : "down");
    const Id moved = add_move(nodes, fmt::format("{}_{}", name, way), input, x, y);
    input = add_merge(nodes, fmt::format("{}_{}_mean", name, way), "average", input, moved);
  }
  return input;
}

std::string matrix_knob(const std::array<PrimaryMix::Light, kChannels>& columns) {
  std::string knob = " matrix {\n";
  for (size_t row = 0; row < kChannels; ++row)
    knob += fmt::format("  {{{:.9g} {:.9g} {:.9g}}}\n", columns[0][row], columns[1][row], columns[2][row]);
  return knob + " }\n";
}

// A monitor's picture in all its blurs: the node of each band, whose levels are the channels rgb and the
// layers gw1 and on, and the frame that holds it, in enlarged pixels.
struct Blurs {
  std::vector<Id> bands;
  int width = 0, height = 0, left = 0, bottom = 0;
};

std::string level_channel(size_t level, const char* colour) {
  return level == 0 ? std::string("rgba.") + colour : fmt::format("gw{}.{}", level, colour);
}

Blurs add_blurs(Nodes& nodes, const v1::Monitor& monitor, const std::string& name, Id picture, size_t bands) {
  // Light that spreads beyond the picture's edge is kept as far as footprints may be centred there.
  const int longer_px = std::max(monitor.width_px(), monitor.height_px()),
            margin_px = bands < 2   ? 32
                        : bands < 3 ? 96
                                    : 96 + longer_px / 2;
  constexpr int kWhole = kReduced[1] * kReduced[2];
  const auto whole = [](int pixels) { return (pixels + kWhole - 1) / kWhole * kWhole; };
  Blurs blurs;
  blurs.left = blurs.bottom = kEnlarged * margin_px;
  blurs.width = whole(kEnlarged * (monitor.width_px() + 2 * margin_px));
  blurs.height = whole(kEnlarged * (monitor.height_px() + 2 * margin_px));
  Id level = add_reformat(nodes, name + "_enlarged", picture, kEnlarged * monitor.width_px(),
                          kEnlarged * monitor.height_px(), "distort\n filter Impulse");
  level = add_reformat(nodes, name + "_frame", level, blurs.width, blurs.height,
                       "none\n center false\n black_outside true\n filter Impulse");
  level = add_move(nodes, name + "_middle", level, blurs.left, blurs.bottom);
  int width = blurs.width, height = blurs.height;
  for (size_t b = 0; b < bands; ++b) {
    if (b > 0) {
      width /= kReduced[b], height /= kReduced[b];
      level = add_reformat(nodes, fmt::format("{}_band{}", name, b), level, width, height,
                           "distort\n black_outside true\n filter Impulse");
    }
    Id band = level;
    for (size_t i = 0; i < kSteps[b].size(); ++i) {
      const std::string here = fmt::format("{}_blur{}_{}", name, b, i + 1);
      level = add_blur(nodes, here, level, kSteps[b][i]);
      std::string copied;
      for (size_t c = 0; c < kChannels; ++c)
        copied += fmt::format(" from{0} rgba.{1}\n to{0} gw{2}.{1}\n", c, kColours[c], i + 1);
      band = nodes.add("Copy", here + "_kept", {band, level}, copied);
    }
    blurs.bands.push_back(band);
  }
  return blurs;
}

// How far a width, of which B's red is the variance, has passed from the level before `level` to it.
std::string passed(const Band& band, size_t level) {
  const double from = band[level - 1], to = band[level];
  return fmt::format("clamp((Br-{:.7g})*{:.7g})", from, 1.0 / (to - from));
}

// The light of a band's levels for a width: the mix of two neighbours, as a sum of differences that the width
// has passed. Beyond the last level `next`, the band above, takes over.
std::string level_mix(const Band& band, size_t b, const Band* next, const char* colour) {
  std::string mix = b == 0 ? fmt::format("A{}", level_channel(0, colour))
                           : fmt::format("{}*A{}", passed(band, 1), level_channel(1, colour));
  for (size_t i = b == 0 ? 1 : 2; i < band.size(); ++i)
    mix +=
        fmt::format("+{}*(A{}-A{})", passed(band, i), level_channel(i, colour), level_channel(i - 1, colour));
  return next ? fmt::format("({})*(1-{})", mix, passed(*next, 1)) : mix;
}

// One channel of a mode, or all of a colourless matte's.
struct ChannelOfMode {
  int mode = 0;
  std::string channel;       // in the layers' names
  std::vector<int> colours;  // that it stands for
};

// What Nuke allows in a name.
std::string node_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return !std::isalnum(c); }, '_');
  return name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) ? "_" + name : name;
}

std::string introduction(const MatteOutline& outline, const std::string& file) {
  std::string text = fmt::format(
      "# The object of {} in front of any picture: plug one, in linear light, into each input of the group\n"
      "# that has the name of a monitor. Made by glasswing nuke; docs/hosts.md says how exact it is.\n",
      file);
  if (outline.metadata.footprint() == kBoxFootprint)
    text += "# The footprints of this matte are boxes; they are shown as Gaussians of the same width.\n";
  return text;
}

class Graph {
 public:
  Graph(const MatteOutline& outline, Needs needs, const PrimaryMix& mix)
      : outline_(outline), needs_(std::move(needs)), mix_(mix), ladder_(ladder()) {}

  Nodes nodes() {
    const Id matte = nodes_.add("Input", "matte", {}, "");
    for (int level = 1; level <= static_cast<int>(kSteps[0].size()); ++level)
      nodes_.text += fmt::format("add_layer {{gw{0} gw{0}.red gw{0}.green gw{0}.blue}}\n", level);
    Id sum = add_expression(nodes_, "Expression", "F", {matte}, foreground());
    for (int t = 0; t < outline_.metadata.monitors_size(); ++t) sum = add_monitor(t, matte, sum);
    nodes_.begin_column();
    if (!mix_.is_unit()) {
      std::array<PrimaryMix::Light, kChannels> columns{};
      for (size_t c = 0; c < kChannels; ++c) columns[c] = mix_.primaries(unit(c));
      sum = nodes_.add("ColorMatrix", "primaries", {sum}, matrix_knob(columns));
    }
    nodes_.add("Output", "Output1", {sum}, "");
    return std::move(nodes_);
  }

 private:
  static PrimaryMix::Light unit(size_t channel) {
    PrimaryMix::Light light{};
    light[channel] = 1.0f;
    return light;
  }

  // Alpha is the coverage.
  static std::array<std::string, 4> foreground() {
    std::array<std::string, 4> values;
    for (size_t c = 0; c < kChannels; ++c)
      values[c] = fmt::format("foreground_F.{}*(fmod(trunc(foreground_flags.Y/8),2)<0.5)", kColours[c]);
    values[3] = "foreground_coverage.Y";
    return values;
  }

  std::vector<ChannelOfMode> channels_of(int mode) const {
    if (outline_.colourless) return {{mode, "Y", {0, 1, 2}}};
    std::vector<ChannelOfMode> channels;
    for (int c = 0; c < kChannels; ++c) channels.push_back({mode, kColours[c], {c}});
    return channels;
  }

  std::array<int, kBands> taps_of(const ChannelOfMode& which, int texture) {
    const Need& need = needs_.at(which.mode, which.colours[0], texture);
    if (need.light <= 0.0) return {};
    return taps_for(need, static_cast<double>(outline_.width_px) * outline_.height_px);
  }

  // Adds the light of a monitor to `sum`.
  Id add_monitor(int texture, Id matte, Id sum) {
    const v1::Monitor& monitor = outline_.metadata.monitors(texture);
    const std::string name = node_name(monitor.name());
    nodes_.begin_column();
    Id picture = nodes_.add("Input", name, {}, fmt::format(" number {}\n", texture + 1));
    size_t bands = 0;
    for (int mode = 0; mode < outline_.modes_per_channel; ++mode) {
      for (const ChannelOfMode& which : channels_of(mode))
        bands = std::max(bands, static_cast<size_t>(kBands - std::ranges::count(taps_of(which, texture), 0)));
    }
    if (bands == 0) return sum;  // no mode looks at this monitor
    picture = nodes_.add("Remove", name + "_rgb", {picture}, " operation keep\n channels rgb\n");
    picture = add_reformat(nodes_, name + "_stretched", picture, monitor.width_px(), monitor.height_px(),
                           "distort");
    picture = nodes_.add("Crop", name + "_cropped", {picture},
                         fmt::format(" box {{0 0 {} {}}}\n", monitor.width_px(), monitor.height_px()));
    if (!mix_.is_unit()) {
      std::array<PrimaryMix::Light, kChannels> columns{};
      for (size_t c = 0; c < kChannels; ++c) columns[c] = mix_.seen(texture, unit(c));
      picture = nodes_.add("ColorMatrix", name + "_seen", {picture}, matrix_knob(columns));
    }
    const Blurs blurs = add_blurs(nodes_, monitor, name, picture, bands);
    for (int mode = 0; mode < outline_.modes_per_channel; ++mode) {
      nodes_.begin_column();
      Id light = Nodes::kNone;
      for (const ChannelOfMode& which : channels_of(mode))
        light = add_mode(which, texture, matte, blurs, light);
      if (light != Nodes::kNone)
        sum = add_merge(nodes_, fmt::format("{}_mode{}_added", name, mode + 1), "plus", sum, light);
    }
    return sum;
  }

  // Adds to `sum` what a monitor's picture sends by one mode: rgb, alpha 0.
  Id add_mode(const ChannelOfMode& which, int texture, Id matte, const Blurs& blurs, Id sum) {
    const std::array<int, kBands> taps = taps_of(which, texture);
    if (taps[0] == 0) return sum;
    const v1::Monitor& monitor = outline_.metadata.monitors(texture);
    const std::string name =
        fmt::format("{}_mode{}_{}", node_name(monitor.name()), which.mode + 1, which.channel);
    const auto layer = [&which](const char* of) {
      return fmt::format("mode{}_{}.{}", which.mode + 1, of, which.channel);
    };
    const bool longish = taps[0] > 1;
    const double share = 1 / (1 + kMaxSpread * kMaxSpread);
    // r: variance of what each tap sees, px^2; g, b: the taps' standard deviation, px right and up; a: weight
    const std::string variance = longish ? fmt::format("max(mean-apart,{:.9g}*(mean+apart))", share) : "mean";
    const auto spread = [&](const char* part) {
      return longish ? fmt::format("sqrt(min(2*apart,{:.9g}*(mean+apart)))*{}", 1 - share, part) : "0";
    };
    const Id shape = add_expression(
        nodes_, "Expression", name + "_shape", {matte},
        {variance, spread("cos(angle)"), spread("-sin(angle)"),
         fmt::format("{}*(abs({}-{})<0.5)*(fmod(trunc(foreground_flags.Y/8),2)<0.5)", layer("weight"),
                     layer("texture"), texture)},
        {{"mean", fmt::format("0.5*({}+{})", layer("xx"), layer("yy"))},
         {"apart", fmt::format("hypot(0.5*({}-{}),{})", layer("xx"), layer("yy"), layer("xy"))},
         {"angle", fmt::format("0.5*atan2(2*{},{}-{})", layer("xy"), layer("xx"), layer("yy"))}});
    for (size_t k = 0; k < static_cast<size_t>(taps[0]); ++k) {
      const std::string tap = fmt::format("{}_tap{}", name, k + 1);
      const int place = kTaps[k].place;
      const Id map = add_expression(
          nodes_, "Expression", tap + "_uv", {shape},
          {fmt::format("({}+{}*({}+({})*g))/{}", blurs.left, kEnlarged, layer("x"), place, blurs.width),
           fmt::format("({}+{}*({}-{}+({})*b))/{}", blurs.bottom, kEnlarged, monitor.height_px(), layer("y"),
                       place, blurs.height),
           "0", "0"});
      for (size_t b = 0; b < blurs.bands.size() && static_cast<int>(k) < taps[b]; ++b) {
        const Id seen = nodes_.add("STMap", fmt::format("{}_band{}", tap, b), {blurs.bands[b], map},
                                   " channels all\n uv rgb\n filter Impulse\n");
        const double weight = taps[b] > 1 ? kTaps[k].weight : 1.0;
        std::array<std::string, 4> values{"0", "0", "0", "0"};
        const Band* const next = b + 1 < blurs.bands.size() && taps[b + 1] > 0 ? &ladder_[b + 1] : nullptr;
        for (const int c : which.colours) {
          const size_t colour = c;
          values[colour] =
              fmt::format("{:.9g}*Ba*({})", weight, level_mix(ladder_[b], b, next, kColours[colour]));
        }
        const Id light = add_expression(nodes_, "MergeExpression", fmt::format("{}_light{}", tap, b),
                                        {shape, seen}, values);
        sum = sum == Nodes::kNone ? light
                                  : add_merge(nodes_, fmt::format("{}_sum{}", tap, b), "plus", sum, light);
      }
    }
    return sum;
  }

  const MatteOutline& outline_;
  Needs needs_;
  const PrimaryMix& mix_;
  const std::vector<Band> ladder_;
  Nodes nodes_;
};

}  // namespace

absl::StatusOr<NukeScript> nuke_script(std::string_view matte, const std::string& file) {
  if (const size_t at = file.find_first_of("\"\\[]{}$#%\n\r\t"); at != std::string::npos) {
    return absl::InvalidArgumentError(fmt::format(
        "the matte is {}; the character {} has a meaning in Nuke's scripts, so its name must do without",
        file, file[at]));
  }
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(matte));
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(outline.metadata));
  GW_ASSIGN_OR_RETURN(Needs needs, needs_of(matte, outline, ladder()));
  const Nodes group = Graph(outline, std::move(needs), mix).nodes();
  NukeScript script{introduction(outline, file), group.count() + 2};
  script.text +=
      fmt::format("Read {{\n inputs 0\n file \"{}\"\n raw true\n name Matte\n}}\nset N0 [stack 0]\n", file);
  for (int t = 0; t < outline.metadata.monitors_size(); ++t) script.text += "push 0\n";
  script.text +=
      fmt::format("push $N0\nGroup {{\n inputs {}\n name Glasswing_{}\n ypos 120\n}}\n{}end_group\n",
                  1 + outline.metadata.monitors_size(),
                  node_name(std::filesystem::path(file).stem().string()), group.text);
  return script;
}

}  // namespace glasswing
