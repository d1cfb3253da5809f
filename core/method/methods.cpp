#include "core/method/methods.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr MethodOption kSilhouetteTolerance{
    .name = "silhouette_tolerance",
    .usual = "0.003",
    .help = "smallest rms difference from the empty stage, of full scale, that makes a pixel the object's",
    .high = 1.0};

std::vector<MethodOption> gaussian_options() {
  return {
      {.name = "modes",
       .usual = "8",
       .help = "most footprints of a pixel's channel; at most 4 of them on one monitor",
       .low = 1.0,
       .high = 8.0,
       .whole = true},
      {.name = "oriented",
       .usual = "1",
       .help = "0: footprints keep only their widths along x and y",
       .high = 1.0,
       .whole = true},
      kSilhouetteTolerance,
      {.name = "images",
       .usual = "all",
       .help = "solve as if no more than this many images had been taken",
       .low = 40.0,
       .high = 20000.0,
       .whole = true},
      {.name = "footprints",
       .usual = "gaussian",
       .help = "any: pixels that Gaussians explain poorly get pyramids of many coefficients",
       .choices = {"gaussian", "any"}},
  };
}

std::vector<MethodOption> hierarchical_options() {
  return {
      {.name = "partial_cover",
       .usual = "1",
       .help = "1: a pixel of the object may also show part of what lies straight behind",
       .high = 1.0,
       .whole = true},
      kSilhouetteTolerance,
  };
}

std::vector<MethodOption> fringe_options() {
  return {
      {.name = "modes",
       .usual = "1",
       .help = "most footprints of a pixel's channel on one monitor",
       .low = 1.0,
       .high = 4.0,
       .whole = true},
      kSilhouetteTolerance,
      {.name = "tolerance",
       .usual = "0.02",
       .help = "a pixel is flagged if its response to the waves is further from a footprint's, of its light",
       .high = 0.5},
  };
}

std::vector<MethodOption> alpha_options() {
  return {
      {.name = "backings",
       .usual = "2",
       .help = "2: triangulation from all solids; 1: keying from the most colourful one",
       .low = 1.0,
       .high = 2.0,
       .whole = true},
      {.name = "a1",
       .usual = "1",
       .help = "Vlahos's constant a1, the key's density",
       .low = 0.1,
       .high = 10.0,
       .only_with = "backings=1"},
      {.name = "a2",
       .usual = "1",
       .help = "Vlahos's constant a2, how much key the object's own colours have",
       .low = 0.5,
       .high = 1.5,
       .only_with = "backings=1"},
      kSilhouetteTolerance,
  };
}

std::vector<MethodOption> ramp_silhouette_options() {
  return {
      {.name = "threshold_sd",
       .usual = "5.5",
       .help = "a pixel shows the object if it differs from the empty stage by so many sd of the noise ...",
       .low = 1.0,
       .high = 1000.0},
      {.name = "least_difference",
       .usual = "0.002",
       .help = "... and by this share of full scale",
       .high = 1.0},
      {.name = "dilation_px",
       .usual = "0.3 % of the diagonal",
       .help = "closes gaps in the object up to this half width",
       .high = 1000.0,
       .whole = true},
      {.name = "erosion_px",
       .usual = "as dilation_px",
       .help = "takes the object's rim back by this much afterwards",
       .high = 1000.0,
       .whole = true},
      {.name = "fill_holes",
       .usual = "1",
       .help = "1: holes in the silhouette belong to the object",
       .high = 1.0,
       .whole = true},
      {.name = "edge_px",
       .usual = "1",
       .help = "width of the object's edge, where alpha may lie between 0 and 1",
       .high = 20.0,
       .whole = true},
  };
}

std::vector<MethodOption> ramp_highlight_options() {
  return {
      {.name = "highlights",
       .usual = "1",
       .help = "0: the ramp is the only light",
       .high = 1.0,
       .whole = true},
      {.name = "delta",
       .usual = "0.05",
       .help = "a pixel brighter than the ramp by this share is a highlight; the paper used 0.03 to 0.10",
       .high = 1.0},
      {.name = "highlight_rise",
       .usual = "0.02",
       .help = "pixels around a highlight belong to it if brighter than the object further off by this share",
       .low = 0.001,
       .high = 1.0},
      {.name = "highlight_reach_px",
       .usual = "4 % of the diagonal",
       .help = "half the width of the widest highlight",
       .low = 1.0,
       .high = 1000.0,
       .whole = true},
      {.name = "highlight_blur_px",
       .usual = "1",
       .help = "sigma that smooths the interpolation across a highlight",
       .high = 100.0},
      {.name = "highlight_gain", .usual = "1", .help = "factor applied to highlights", .high = 100.0},
      {.name = "clipped_highlight",
       .usual = "1",
       .help = "least value of a highlight that clips all channels; 0: as measured",
       .high = 100.0},
  };
}

std::vector<MethodOption> ramp_options() {
  std::vector<MethodOption> options = ramp_silhouette_options();
  const std::vector<MethodOption> highlights = ramp_highlight_options();
  options.insert(options.end(), highlights.begin(), highlights.end());
  const std::vector<MethodOption> smoothing = {
      {.name = "smoothing",
       .usual = "adaptive",
       .help = "how noise is smoothed in space and time",
       .choices = {"adaptive", "perona-malik", "none"}},
      {.name = "smoothing_reach",
       .usual = "1",
       .help = "number of frames used before and after",
       .high = 4.0,
       .whole = true},
      {.name = "smoothing_iterations",
       .usual = "10",
       .help = "of perona-malik",
       .low = 1.0,
       .high = 1000.0,
       .whole = true},
      {.name = "smoothing_contrast",
       .usual = "4",
       .help = "of perona-malik, in monitor pixels: larger steps are edges",
       .low = 0.001,
       .high = 10000.0},
      {.name = "smoothing_conductance",
       .usual = "exponential",
       .help = "of perona-malik",
       .choices = {"exponential", "rational"}},
  };
  options.insert(options.end(), smoothing.begin(), smoothing.end());
  return options;
}

bool takes(const MethodOption& option, const std::string& value) {
  if (!option.choices.empty()) return std::ranges::count(option.choices, value) > 0;
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  return !value.empty() && *end == '\0' && number >= option.low && number <= option.high &&
         (!option.whole || number == std::floor(number));
}

absl::StatusOr<const MethodOption*> find_option(std::string_view method, const std::string& name) {
  const std::span<const MethodOption> options = options_of(method);
  const auto found = std::ranges::find(options, name, &MethodOption::name);
  if (found != options.end()) return &*found;
  std::vector<std::string_view> names;
  for (const MethodOption& option : options) names.push_back(option.name);
  return absl::InvalidArgumentError(
      fmt::format("option \"{}\" is not known to {}; it has: {}", name, method, fmt::join(names, ", ")));
}

}  // namespace

std::span<const SolvingMethod> solving_methods() {
  static const std::vector<SolvingMethod> methods = {
      {.name = "gaussian",
       .version = 3,
       .stimulus = "gauss_stripe",
       .rank = 1,
       .options = gaussian_options()},
      {.name = "hierarchical",
       .version = 4,
       .stimulus = "square",
       .rank = 3,
       .options = hierarchical_options()},
      {.name = "fringe", .version = 4, .stimulus = "sinusoid", .rank = 2, .options = fringe_options()},
      {.name = "alpha", .version = 2, .stimulus = "solid", .rank = 4, .options = alpha_options()},
      {.name = kRampMethod, .version = 1, .stimulus = "ramp", .rank = 5, .options = ramp_options()},
  };
  return methods;
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const SolvingMethod& method : solving_methods()) names.emplace_back(method.name);
  return names;
}

absl::Status check_method(std::string_view name) {
  const std::vector<std::string> names = method_names();
  if (std::ranges::find(names, name) != names.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("method is \"{}\"; it must be one of: {}", name, fmt::join(names, ", ")));
}

std::string computes(const std::string& method) {
  const std::map<std::string, int>& versions = method_versions();
  return fmt::format("{}/{} matte/{}", method, versions.at(method), versions.at("matte"));
}

std::span<const MethodOption> options_of(std::string_view method) {
  const std::span<const SolvingMethod> all = solving_methods();
  const auto found = std::ranges::find(all, method, &SolvingMethod::name);
  return found == all.end() ? std::span<const MethodOption>() : found->options;
}

const std::map<std::string, int>& method_versions() {
  static const std::map<std::string, int> versions = [] {
    std::map<std::string, int> all = {{"matte", 2}};
    for (const SolvingMethod& method : solving_methods()) all.emplace(method.name, method.version);
    return all;
  }();
  return versions;
}

std::string range_of(const MethodOption& option) {
  if (!option.choices.empty()) {
    const std::span<const std::string_view> all = option.choices;
    return fmt::format("{} or {}", fmt::join(all.first(all.size() - 1), ", "), all.back());
  }
  if (option.whole && option.high == option.low + 1.0)
    return fmt::format("{:g} or {:g}", option.low, option.high);
  return fmt::format("{}{:g} to {:g}", option.whole ? "a whole number, " : "", option.low, option.high);
}

std::string description_of(const MethodOption& option) {
  const std::string with = option.only_with.empty() ? "" : fmt::format("; only with {}", option.only_with);
  return fmt::format("{} ({}; default: {}{})", option.help, range_of(option), option.usual, with);
}

absl::StatusOr<OptionValues> OptionValues::read(std::string_view method,
                                                const std::map<std::string, std::string>& given) {
  OptionValues read;
  for (const MethodOption& option : options_of(method)) {
    std::string usual(option.usual);
    if (takes(option, usual)) read.values_.emplace(option.name, std::move(usual));
  }
  for (const auto& [name, value] : given) {
    GW_ASSIGN_OR_RETURN(const MethodOption* option, find_option(method, name));
    if (!takes(*option, value))
      return absl::InvalidArgumentError(
          fmt::format("{} is \"{}\"; it must be {}", name, value, range_of(*option)));
    read.values_.insert_or_assign(name, value);
  }
  for (const MethodOption& option : options_of(method)) {
    if (option.only_with.empty() || !given.contains(std::string(option.name))) continue;
    GW_ASSIGN_OR_RETURN(const auto needed, parse_setting(std::string(option.only_with)));
    if (read.text(needed.first) != needed.second)
      return absl::InvalidArgumentError(
          fmt::format("option \"{}\" of {} needs {} with it", option.name, method, option.only_with));
  }
  return read;
}

double OptionValues::number(std::string_view option) const {
  return std::strtod(text(option).c_str(), nullptr);
}

const std::string& OptionValues::text(std::string_view option) const {
  const auto found = values_.find(option);
  assert(found != values_.end());
  return found->second;
}

absl::StatusOr<std::pair<std::string, std::string>> parse_setting(const std::string& setting) {
  const size_t equals = setting.find('=');
  if (equals == std::string::npos || equals == 0) {
    return absl::InvalidArgumentError(
        fmt::format("--set {}: it must be NAME=VALUE, such as modes=2", setting));
  }
  return std::pair(setting.substr(0, equals), setting.substr(equals + 1));
}

}  // namespace glasswing
