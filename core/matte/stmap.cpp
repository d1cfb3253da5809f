#include "core/matte/stmap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/matte/exr_writer.h"

namespace glasswing {
namespace {

// No object sends more light than it gets: such a mode's light is that of others, less what they have too
// much.
constexpr float kMaxWeight = 1.05f;
constexpr std::array<const char*, kChannels> kColours{"R", "G", "B"};

}  // namespace

const Mode* strongest_mode(const Matte& matte, int x, int y, int channel, int texture) {
  const Mode* strongest = nullptr;
  for (const Mode& mode : matte.modes(x, y, channel)) {
    if (mode.weight <= 0.0f || mode.weight > kMaxWeight || (texture >= 0 && mode.texture != texture))
      continue;
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

absl::StatusOr<std::string> encode_stmap(const Matte& matte, int texture, int channel) {
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
  const auto on_monitor = [&](int x, int y) -> const Mode* {
    const Mode* mode = strongest_mode(matte, x, y, channel, texture);
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
    fill(fmt::format("weight.{}", kColours[static_cast<size_t>(c)]), [&](int x, int y) {
      const Mode* mode = strongest_mode(matte, x, y, c, texture);
      return mode != nullptr ? mode->weight : 0.0f;
    });
  }
  ExrPart part{.name = "stmap", .channels = {}, .attributes = {}};
  std::vector<const float*> channels;
  for (const auto& [name, plane] : planes) {
    part.channels.push_back(name);
    channels.push_back(plane.data());
  }
  part.attributes["glasswing:conventions"] = fmt::format(
      "R = x / {}, G = 1 - y / {}: where channel {} of session {} looks on monitor {}, from its "
      "bottom left corner; B = A = 1 where it does. weight: of the path. blur: its sigma, "
      "monitor px.",
      monitor.width_px(), monitor.height_px(), kColours[static_cast<size_t>(channel)], metadata.session(),
      monitor.name());
  return written_exr([&] {
    ExrWriter writer({part}, window_of(matte));
    for (int y = 0; y < matte.height_px(); ++y) {
      writer.put(0, channels);
      for (const float*& row : channels) row += matte.width_px();
    }
    return writer.finish();
  });
}

}  // namespace glasswing
