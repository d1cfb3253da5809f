#include "core/matte/stmap.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/matte/exr_writer.h"
#include "core/matte/light_paths.h"

namespace glasswing {
namespace {

constexpr float kMaxWeight = 1.05f;
constexpr std::array<const char*, kChannels> kColourNames{"R", "G", "B"};

// One part whose channels, by name, are as large as the matte.
absl::StatusOr<std::string> encode_planes(const std::map<std::string, std::vector<float>>& planes,
                                          const std::string& conventions, const Matte& matte) {
  ExrPart part{.name = "stmap", .channels = {}, .attributes = {{"glasswing:conventions", conventions}}};
  std::vector<const float*> rows;
  for (const auto& [name, plane] : planes) {
    part.channels.push_back(name);
    rows.push_back(plane.data());
  }
  return written_exr([&] {
    ExrWriter writer({part}, window_of(matte));
    for (int y = 0; y < matte.height_px(); ++y) {
      writer.put(0, rows);
      for (const float*& row : rows) row += matte.width_px();
    }
    return writer.finish();
  });
}

}  // namespace

bool is_plausible(const Mode& mode) {
  return mode.weight > 0.0f && mode.weight <= kMaxWeight;
}

const Mode* strongest_mode(const Matte& matte, int x, int y, int channel, int texture) {
  const Mode* strongest = nullptr;
  for (const Mode& mode : matte.modes(x, y, channel)) {
    if (!is_plausible(mode) || (texture >= 0 && mode.texture != texture)) continue;
    if (strongest == nullptr || mode.weight > strongest->weight) strongest = &mode;
  }
  return strongest;
}

int strongest_channel(const Matte& matte, int texture) {
  std::array<double, kChannels> weight{};
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const Mode* mode = strongest_mode(matte, x, y, c, texture);
        if (mode != nullptr) weight[static_cast<size_t>(c)] += static_cast<double>(mode->weight);
      }
    }
  }
  constexpr int kGreen = 1;
  constexpr double kMinRatio = 1.1;
  const auto strongest = std::ranges::max_element(weight);
  return *strongest > kMinRatio * weight[kGreen] ? static_cast<int>(strongest - weight.begin()) : kGreen;
}

absl::StatusOr<int> texture_named(const v1::MatteMetadata& metadata, const std::string& monitor) {
  if (metadata.monitors().empty()) return absl::DataLossError("the matte's header names no monitors");
  if (monitor.empty()) return 0;
  std::vector<std::string> names;
  for (int t = 0; t < metadata.monitors_size(); ++t) {
    if (metadata.monitors(t).name() == monitor) return t;
    names.push_back(metadata.monitors(t).name());
  }
  return absl::InvalidArgumentError(
      fmt::format("the monitor is \"{}\"; this matte has: {}", monitor, fmt::join(names, ", ")));
}

absl::StatusOr<std::string> encode_stmap(const Matte& matte, int texture, int channel, int path) {
  const v1::MatteMetadata& metadata = matte.metadata;
  if (texture < 0 || texture >= metadata.monitors_size()) {
    return absl::InvalidArgumentError(
        fmt::format("there is no texture {}; the matte has {} monitors", texture, metadata.monitors_size()));
  }
  const v1::Monitor& monitor = metadata.monitors(texture);
  if (monitor.width_px() < 1 || monitor.height_px() < 1) {
    return absl::InvalidArgumentError(
        fmt::format("the matte does not say how large its monitor \"{}\" is", monitor.name()));
  }
  const auto width = static_cast<double>(monitor.width_px());
  const auto height = static_cast<double>(monitor.height_px());
  std::optional<LightPaths> paths;
  if (path > 0) {
    paths.emplace(matte, texture);
    if (path > paths->count()) {
      return absl::InvalidArgumentError(fmt::format("path is {}; on monitor \"{}\" the matte has {}", path,
                                                    monitor.name(), paths->count()));
    }
  }
  const auto mode_at = [&](int x, int y, int c) {
    return paths ? paths->mode(x, y, c, path - 1) : strongest_mode(matte, x, y, c, texture);
  };
  const auto on_monitor = [&](int x, int y) -> const Mode* {
    const Mode* mode = mode_at(x, y, channel);
    const bool inside = mode != nullptr && mode->x_px >= 0.0f && static_cast<double>(mode->x_px) <= width &&
                        mode->y_px >= 0.0f && static_cast<double>(mode->y_px) <= height;
    return inside ? mode : nullptr;
  };
  std::map<std::string, std::vector<float>> planes;
  const auto fill = [&](const std::string& name, const auto& value_at) {
    std::vector<float>& plane = planes[name];
    for (int y = 0; y < matte.height_px(); ++y) {
      for (int x = 0; x < matte.width_px(); ++x) plane.push_back(value_at(x, y));
    }
  };
  const auto fill_from_mode = [&](const char* name, const auto& of) {
    fill(name, [&](int x, int y) {
      const Mode* mode = on_monitor(x, y);
      return mode != nullptr ? static_cast<float>(of(*mode)) : 0.0f;
    });
  };
  fill_from_mode("R", [&](const Mode& mode) { return static_cast<double>(mode.x_px) / width; });
  fill_from_mode("G", [&](const Mode& mode) { return 1.0 - static_cast<double>(mode.y_px) / height; });
  fill_from_mode("B", [](const Mode&) { return 1.0; });
  fill_from_mode("A", [](const Mode&) { return 1.0; });
  fill_from_mode("blur.Y", [](const Mode& mode) {
    return std::sqrt(std::max(0.5f * (mode.xx_px2 + mode.yy_px2), 0.0f));
  });
  for (int c = 0; c < kChannels; ++c) {
    fill(fmt::format("weight.{}", kColourNames[static_cast<size_t>(c)]), [&](int x, int y) {
      const Mode* mode = mode_at(x, y, c);
      return mode != nullptr ? mode->weight : 0.0f;
    });
  }
  const std::string conventions = fmt::format(
      "R = x / {}, G = 1 - y / {}: where channel {} of session {} looks on monitor {}, from its "
      "bottom left corner; B = A = 1 where it does. weight: of the path. blur: its sigma, "
      "monitor px.",
      monitor.width_px(), monitor.height_px(), kColourNames[static_cast<size_t>(channel)], metadata.session(),
      monitor.name());
  return encode_planes(planes, conventions, matte);
}

}  // namespace glasswing
