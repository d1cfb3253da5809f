#include "compositing/view/matte_panels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/composite/stmap.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

using Code = std::array<std::uint8_t, 3>;

constexpr int kBar_px = 256, kChart_px = 96;
constexpr double kDarkestWhite = 0.02;  // below, a frame's noise would look like light

std::uint8_t code_of(double share) {
  return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
}

Code gray(double share) {
  return {code_of(share), code_of(share), code_of(share)};
}

// Dark blue to yellow, with rising lightness; the stops are equally spaced in CIE L*.
Code scale_colour(double share) {
  constexpr std::array<std::array<double, 3>, 6> kStops{{{0.17, 0.08, 0.36},
                                                         {0.20, 0.28, 0.54},
                                                         {0.12, 0.47, 0.56},
                                                         {0.17, 0.64, 0.50},
                                                         {0.52, 0.80, 0.29},
                                                         {0.98, 0.91, 0.17}}};
  const double place = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const size_t stop = std::min(static_cast<size_t>(place), kStops.size() - 2);
  const double part = place - static_cast<double>(stop);
  Code colour{};
  for (size_t c = 0; c < 3; ++c)
    colour[c] = code_of((1.0 - part) * kStops[stop][c] + part * kStops[stop + 1][c]);
  return colour;
}

// The channel in a panel's title.
std::string owner(const Matte& matte, int channel) {
  constexpr std::array<const char*, kChannels> kOwners{"red's", "green's", "blue's"};
  return matte.is_colourless() ? "the" : kOwners[channel];
}

template <typename Colour>
CodeImage painted(int width, int height, const Colour& colour) {
  CodeImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) std::ranges::copy(Code(colour(x, y)), &image.at(x, y, 0));
  }
  return image;
}

template <typename Colour>
CodeImage painted(const Matte& matte, const Colour& colour) {
  return painted(matte.width_px(), matte.height_px(), colour);
}

PanelKey key_of(const Code& colour, std::string name) {
  return {painted(1, 1, [&](int, int) { return colour; }), std::move(name)};
}

template <typename Colour>
CodeImage line_of(const Colour& colour) {
  return painted(kBar_px, 1, [&](int x, int) { return colour((x + 0.5) / kBar_px); });
}

// 1, 2 or 5 times a power of ten: the largest not above `value`, and the smallest not below it.
double round_down(double value) {
  const double ten = std::pow(10.0, std::floor(std::log10(value) + 1e-9));
  const double part = value / ten * (1.0 + 1e-9);
  return ten * (part >= 5.0 ? 5.0 : part >= 2.0 ? 2.0 : 1.0);
}
double round_up(double value) {
  const double below = round_down(value);
  if (below * (1.0 + 1e-6) >= value) return below;
  return round_down(below * (std::fmod(std::log10(below) + 1e-9, 1.0) == 0.0 ? 2.0 : 2.51));
}

double percentile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[at];
}

bool shows_object(const Matte& matte, int x, int y) {
  return matte.coverage(x, y) > 0.0f;
}

// get(x, y) of the object's pixels whose value `counts`, or of all such pixels if there is no object.
template <typename Get, typename Counts>
std::vector<double> values_of(const Matte& matte, const Get& get, const Counts& counts) {
  std::vector<double> object, all;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      const double value = get(x, y);
      if (!counts(value)) continue;
      all.push_back(value);
      if (shows_object(matte, x, y)) object.push_back(value);
    }
  }
  return object.empty() ? all : object;
}

bool is_positive(double value) {
  return std::isfinite(value) && value > 0.0;
}

// "12 %": the share of the object's pixels, or of all pixels if there is no object.
template <typename Is>
std::string share_of(const Matte& matte, const Is& is) {
  const std::vector<double> found = values_of(
      matte, [&](int x, int y) { return is(x, y) ? 1.0 : 0.0; }, [](double) { return true; });
  const auto count = static_cast<double>(std::ranges::count(found, 1.0));
  const double percent = 100.0 * count / static_cast<double>(found.size());
  return count > 0.0 && percent < 0.1 ? "< 0.1 %" : fmt::format("{:.3g} %", percent);
}

MattePanel preview_of(const Matte& matte) {
  const auto colour = [&](int x, int y) {
    Code code{};
    for (size_t c = 0; c < kChannels; ++c) {
      float light = matte.foreground(x, y)[c];
      for (const Mode& mode : matte.modes(x, y, static_cast<int>(c))) light += 0.5f * mode.weight;
      code[c] = code_of(static_cast<double>(srgb_of_linear(light)));
    }
    return code;
  };
  return {.name = "preview",
          .title = "Preview: F + half of the weights",
          .picture = painted(matte, colour),
          .keys = {},
          .bar = std::nullopt};
}

MattePanel foreground_of(const Matte& matte) {
  const std::vector<double> lights = values_of(
      matte, [&](int x, int y) { return static_cast<double>(std::ranges::max(matte.foreground(x, y))); },
      is_positive);
  // White is the brightest light except for the top 0.5 %, which are highlights.
  const double white =
      lights.empty() ? 1.0 : std::clamp(round_up(percentile(lights, 0.995)), kDarkestWhite, 1.0);
  const auto code = [white](double light) {
    return code_of(static_cast<double>(srgb_of_linear(static_cast<float>(light / white))));
  };
  MattePanel panel{.name = "foreground",
                   .title = "F: light without the monitors, of full scale",
                   .picture = painted(matte,
                                      [&](int x, int y) {
                                        const auto& light = matte.foreground(x, y);
                                        return Code{code(light[0]), code(light[1]), code(light[2])};
                                      }),
                   .keys = {},
                   .bar = ColourBar{line_of([&](double share) {
                                      const std::uint8_t level = code(share * white);
                                      return Code{level, level, level};
                                    }),
                                    {}}};
  for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0})
    panel.bar->ticks.push_back({share, fmt::format("{:.4g}", share * white)});
  return panel;
}

MattePanel coverage_of(const Matte& matte) {
  MattePanel panel{.name = "coverage",
                   .title = "Coverage: how much of the pixel is object",
                   .picture = painted(matte, [&](int x, int y) { return gray(matte.coverage(x, y)); }),
                   .keys = {},
                   .bar = ColourBar{line_of(gray), {}}};
  for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0})
    panel.bar->ticks.push_back({share, fmt::format("{:.4g}", share)});
  return panel;
}

// Of the channel with most.
size_t mode_count(const Matte& matte, int x, int y) {
  std::ptrdiff_t most = 0;
  for (int c = 0; c < kChannels; ++c) {
    most = std::max(most, std::ranges::count_if(matte.modes(x, y, c),
                                                [](const Mode& mode) { return mode.weight > 0.0f; }));
  }
  return static_cast<size_t>(most);
}

MattePanel modes_of(const Matte& matte) {
  constexpr std::array<Code, kMaxModes + 1> kCounts{{kNoValue,
                                                     {51, 102, 170},
                                                     {60, 180, 150},
                                                     {240, 200, 60},
                                                     {205, 70, 60},
                                                     {190, 80, 150},
                                                     {140, 90, 190},
                                                     {170, 170, 170},
                                                     {240, 240, 240}}};
  const auto count = [&](int x, int y) { return mode_count(matte, x, y); };
  MattePanel panel{.name = "modes",
                   .title = "Modes in the channel with most; % of the object",
                   .picture = painted(matte, [&](int x, int y) { return kCounts[count(x, y)]; }),
                   .keys = {},
                   .bar = std::nullopt};
  for (size_t n = 0; n <= static_cast<size_t>(matte.modes_per_channel()); ++n) {
    panel.keys.push_back(key_of(kCounts[n], fmt::format("{}: {}", n, share_of(matte, [&](int x, int y) {
                                                          return count(x, y) == n;
                                                        }))));
  }
  return panel;
}

// Which pixels few Gaussians do not describe (docs/footprints.md).
MattePanel shape_of(const Matte& matte) {
  struct Kind {
    const char* name;
    Code colour;
  };
  constexpr std::array<Kind, 3> kKinds{
      {{"none", kNoValue}, {"modes", {150, 175, 205}}, {"any shape", {200, 80, 120}}}};
  const auto kind = [&](int x, int y) -> size_t {
    return matte.has_pyramid(x, y) ? 2 : std::min<size_t>(mode_count(matte, x, y), 1);
  };
  MattePanel panel{.name = "shape",
                   .title = "Footprints of any shape; % of the object",
                   .picture = painted(matte, [&](int x, int y) { return kKinds[kind(x, y)].colour; }),
                   .keys = {},
                   .bar = std::nullopt};
  for (size_t k = 0; k < kKinds.size(); ++k) {
    const std::string share = share_of(matte, [&](int x, int y) { return kind(x, y) == k; });
    panel.keys.push_back(key_of(kKinds[k].colour, fmt::format("{}: {}", kKinds[k].name, share)));
  }
  return panel;
}

// Red rises to the right and green downwards; blue distinguishes monitors. A checkerboard of an eighth of the
// height darkens every other square.
Code place_colour(const v1::MatteMetadata& metadata, int texture, double x_px, double y_px) {
  if (texture < 0 || texture >= metadata.monitors_size()) return kNoValue;
  const v1::Monitor& monitor = metadata.monitors(texture);
  if (monitor.width_px() < 1 || monitor.height_px() < 1) return kNoValue;
  if (!std::isfinite(x_px) || !std::isfinite(y_px)) return kNoValue;
  const double height = monitor.height_px(), check = height / 8.0;
  const bool dark =
      (std::llround(std::floor(x_px / check)) + std::llround(std::floor(y_px / check))) % 2 != 0;
  const double light = dark ? 0.78 : 1.0;
  const double blue = metadata.monitors_size() == 1
                          ? 0.35
                          : 0.15 + 0.8 * texture / static_cast<double>(metadata.monitors_size() - 1);
  const auto shade = [](double share) { return 0.1 + 0.9 * std::clamp(share, 0.0, 1.0); };
  return {code_of(light * shade(x_px / monitor.width_px())), code_of(light * shade(y_px / height)),
          code_of(light * blue)};
}

MattePanel centre_of(const Matte& matte, int channel) {
  const auto colour = [&](int x, int y) {
    const Mode* mode = strongest_mode(matte, x, y, channel);
    if (mode == nullptr) return kNoValue;
    return place_colour(matte.metadata, mode->texture, static_cast<double>(mode->x_px),
                        static_cast<double>(mode->y_px));
  };
  MattePanel panel{.name = "centre",
                   .title = fmt::format("Centre: where {} strongest mode looks", owner(matte, channel)),
                   .picture = painted(matte, colour),
                   .keys = {},
                   .bar = std::nullopt};
  for (int t = 0; t < matte.metadata.monitors_size(); ++t) {
    const v1::Monitor& monitor = matte.metadata.monitors(t);
    if (monitor.width_px() < 1 || monitor.height_px() < 1) continue;
    const double step_px = static_cast<double>(monitor.height_px()) / kChart_px;
    const int width =
        std::clamp(static_cast<int>(std::lround(monitor.width_px() / step_px)), 1, 4 * kChart_px);
    panel.keys.push_back({painted(width, kChart_px,
                                  [&](int x, int y) {
                                    return place_colour(matte.metadata, t, (x + 0.5) * step_px,
                                                        (y + 0.5) * step_px);
                                  }),
                          fmt::format("{} {}x{}", monitor.name(), monitor.width_px(), monitor.height_px())});
  }
  return panel;
}

// A logarithmic scale from the 1st to the 99th percentile.
template <typename Get>
MattePanel logarithmic(const Matte& matte, std::string name, std::string title, const Get& get) {
  const std::vector<double> values = values_of(matte, get, is_positive);
  MattePanel panel{.name = std::move(name), .title = std::move(title), .picture = {}, .keys = {}, .bar = {}};
  double low = 1.0, high = 2.0;
  if (!values.empty()) {
    low = round_down(percentile(values, 0.01));
    high = std::max(round_up(percentile(values, 0.99)), round_up(2.0 * low));
  }
  const auto share = [&](double value) { return std::log(value / low) / std::log(high / low); };
  panel.picture = painted(matte, [&](int x, int y) {
    const double value = get(x, y);
    return is_positive(value) ? scale_colour(share(value)) : kNoValue;
  });
  if (values.empty()) {
    panel.keys.push_back(key_of(kNoValue, "not known"));
    return panel;
  }
  panel.bar = ColourBar{line_of(scale_colour), {}};
  const double max_parts = high / low > 150.0 ? 1.0 : 5.0;
  for (double ten = std::pow(10.0, std::floor(std::log10(low) + 1e-9)); ten <= high * 1.001; ten *= 10.0) {
    for (const double part : {1.0, 2.0, 5.0}) {
      const double value = part * ten;
      if (part <= max_parts && value >= low * 0.999 && value <= high * 1.001)
        panel.bar->ticks.push_back({share(value), fmt::format("{:.4g}", value)});
    }
  }
  return panel;
}

MattePanel sigma_of(const Matte& matte, int channel) {
  const bool boxes = matte.metadata.footprint() == kBoxFootprint;
  return logarithmic(
      matte, "sigma",
      fmt::format("Sigma of {} strongest {}, monitor px", owner(matte, channel), boxes ? "box" : "mode"),
      [&matte, channel](int x, int y) {
        const Mode* mode = strongest_mode(matte, x, y, channel);
        return mode == nullptr ? 0.0 : std::sqrt(0.5 * static_cast<double>(mode->xx_px2 + mode->yy_px2));
      });
}

MattePanel uncertainty_of(const Matte& matte, int channel) {
  return logarithmic(matte, "uncertainty",
                     fmt::format("Standard error of {} centre, monitor px", owner(matte, channel)),
                     [&matte, channel](int x, int y) {
                       const Mode* mode = strongest_mode(matte, x, y, channel);
                       return mode == nullptr ? 0.0 : static_cast<double>(mode->centre_sd_px);
                     });
}

// Of kNamedFlags, and of pixels without flags.
constexpr std::array<Code, kNamedFlags.size() + 1> kFlagColours{{{40, 40, 40},
                                                                 {214, 64, 52},
                                                                 {240, 170, 40},
                                                                 {120, 200, 210},
                                                                 {86, 124, 200},
                                                                 {170, 110, 190},
                                                                 {150, 205, 160}}};

MattePanel flags_of(const Matte& matte) {
  const auto found = [&](int x, int y) {
    const auto worst = std::ranges::find_if(
        kNamedFlags, [&](const NamedFlag& named) { return (matte.flags(x, y) & named.flag) != 0; });
    return static_cast<size_t>(worst - kNamedFlags.begin());
  };
  MattePanel panel{.name = "flags",
                   .title = "Flags, the most serious; % of the object",
                   .picture = painted(matte,
                                      [&](int x, int y) {
                                        const size_t flag = found(x, y);
                                        return flag == kNamedFlags.size() && !shows_object(matte, x, y)
                                                   ? kNoValue
                                                   : kFlagColours[flag];
                                      }),
                   .keys = {},
                   .bar = std::nullopt};
  for (size_t flag = 0; flag < kFlagColours.size(); ++flag) {
    const char* const name = flag < kNamedFlags.size() ? kNamedFlags[flag].name : "good";
    panel.keys.push_back(key_of(
        kFlagColours[flag],
        fmt::format("{}: {}", name, share_of(matte, [&](int x, int y) { return found(x, y) == flag; }))));
  }
  std::ranges::reverse(panel.keys);
  return panel;
}

}  // namespace

std::vector<MattePanel> panels_of(const Matte& matte, int channel) {
  return {
      preview_of(matte), foreground_of(matte),      coverage_of(matte),       modes_of(matte),
      shape_of(matte),   centre_of(matte, channel), sigma_of(matte, channel), uncertainty_of(matte, channel),
      flags_of(matte)};
}

}  // namespace glasswing
