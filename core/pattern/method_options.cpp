#include "core/pattern/method_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <vector>

namespace glasswing {

const std::map<std::string, int>& method_versions() {
  static const std::map<std::string, int> versions = {{"alpha", 2},        {"fringe", 2}, {"gaussian", 2},
                                                      {"hierarchical", 2}, {"ramp", 1},   {"matte", 2}};
  return versions;
}

std::span<const std::string_view> option_names(std::string_view method) {
  static const std::map<std::string_view, std::vector<std::string_view>> names = {
      {"gaussian", {"modes", "oriented", "silhouette_tolerance", "images"}},
      {"hierarchical", {"partial_cover", "silhouette_tolerance"}},
      {"fringe", {"modes", "silhouette_tolerance", "tolerance"}},
      {"alpha", {"backings", "a1", "a2", "silhouette_tolerance"}},
      {"ramp",
       {"threshold_sd", "least_difference", "dilation_px", "erosion_px", "fill_holes", "edge_px",
        "highlights", "delta", "highlight_rise", "highlight_reach_px", "highlight_blur_px", "highlight_gain",
        "clipped_highlight", "smoothing", "smoothing_reach", "smoothing_iterations", "smoothing_contrast",
        "smoothing_conductance"}},
  };
  const auto found = names.find(method);
  return found == names.end() ? std::span<const std::string_view>() : found->second;
}

absl::Status check_option(std::string_view method, std::string_view option) {
  return std::ranges::count(option_names(method), option) > 0 ? absl::OkStatus()
                                                              : unknown_option(method, option);
}

absl::Status unknown_option(std::string_view method, std::string_view option) {
  return absl::InvalidArgumentError(fmt::format("option \"{}\" is not known to {}; it has: {}", option,
                                                method, fmt::join(option_names(method), ", ")));
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
