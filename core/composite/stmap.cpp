#include "core/composite/stmap.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/composite/light_paths.h"
#include "core/file/file.h"
#include "core/matte/exr_writer.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr float kMaxWeight = 1.05f;
constexpr std::array<const char*, kChannels> kColourNames{"R", "G", "B"};

using ModeAt = absl::FunctionRef<const Mode*(int x, int y, int channel)>;

// The sums of the strongest modes' weights.
class ChannelWeights {
 public:
  void add(const Matte& rows, int texture) {
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) {
        for (int c = 0; c < kChannels; ++c) {
          const Mode* mode = strongest_mode(rows, x, y, c, texture);
          if (mode != nullptr) weight_[c] += static_cast<double>(mode->weight);
        }
      }
    }
  }
  int strongest() const {
    constexpr int kGreen = 1;
    constexpr double kMinRatio = 1.1;
    const auto strongest = std::ranges::max_element(weight_);
    return *strongest > kMinRatio * weight_[kGreen] ? static_cast<int>(strongest - weight_.begin()) : kGreen;
  }

 private:
  std::array<double, kChannels> weight_{};
};

absl::Status check_monitor(const v1::MatteMetadata& metadata, int texture) {
  if (texture < 0 || texture >= metadata.monitors_size()) {
    return absl::InvalidArgumentError(
        fmt::format("there is no texture {}; the matte has {} monitors", texture, metadata.monitors_size()));
  }
  const v1::Monitor& monitor = metadata.monitors(texture);
  if (monitor.width_px() >= 1 && monitor.height_px() >= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the matte does not record the size of its monitor \"{}\"", monitor.name()));
}

// Throws OpenEXR's exceptions.
class StmapWriter {
 public:
  StmapWriter(const v1::MatteMetadata& metadata, int texture, int channel, const ExrWindow& window,
              const std::optional<fs::path>& file = std::nullopt)
      : width_(static_cast<double>(metadata.monitors(texture).width_px())),
        height_(static_cast<double>(metadata.monitors(texture).height_px())),
        channel_(channel),
        samples_(kPlanes.size() * static_cast<size_t>(window.width_px)) {
    ExrPart part{.name = "stmap", .channels = {}, .attributes = {}};
    for (size_t i = 0; i < kPlanes.size(); ++i) {
      part.channels.push_back(kPlanes[i]);
      planes_[i] = &samples_[i * static_cast<size_t>(window.width_px)];
    }
    part.attributes["glasswing:conventions"] = fmt::format(
        "R = x / {}, G = 1 - y / {}: where channel {} of session {} looks on monitor {}, from its "
        "bottom-left "
        "corner; B = A = 1 where it does. weight: of the path. blur: its sigma, monitor px.",
        metadata.monitors(texture).width_px(), metadata.monitors(texture).height_px(), kColourNames[channel],
        metadata.session(), metadata.monitors(texture).name());
    part.attributes["colorInteropID"] = "data";
    writer_.emplace(std::vector{part}, window, file);
  }

  void put(const Matte& rows, ModeAt mode_at) {
    for (int y = 0; y < rows.height_px(); ++y) {
      for (int x = 0; x < rows.width_px(); ++x) {
        put_pixel(x, mode_at(x, y, channel_));
        for (int c = 0; c < kChannels; ++c) {
          const Mode* mode = mode_at(x, y, c);
          planes_[kWeights[c]][x] = mode != nullptr ? mode->weight : 0.0f;
        }
      }
      writer_->put(0, std::vector<const float*>(planes_.begin(), planes_.end()));
    }
  }
  std::string finish() { return writer_->finish(); }

 private:
  // Sorted, as in the file.
  static constexpr std::array<const char*, 8> kPlanes{"A",      "B",        "G",        "R",
                                                      "blur.Y", "weight.B", "weight.G", "weight.R"};
  static constexpr size_t kA = 0, kB = 1, kG = 2, kR = 3, kBlur = 4;
  static constexpr std::array<size_t, kChannels> kWeights{7, 6, 5};

  void put_pixel(int x, const Mode* mode) {
    const bool inside = mode != nullptr && mode->x_px >= 0.0f && static_cast<double>(mode->x_px) <= width_ &&
                        mode->y_px >= 0.0f && static_cast<double>(mode->y_px) <= height_;
    planes_[kR][x] = inside ? static_cast<float>(static_cast<double>(mode->x_px) / width_) : 0.0f;
    planes_[kG][x] = inside ? static_cast<float>(1.0 - static_cast<double>(mode->y_px) / height_) : 0.0f;
    planes_[kB][x] = planes_[kA][x] = inside ? 1.0f : 0.0f;
    planes_[kBlur][x] = inside ? std::sqrt(std::max(0.5f * (mode->xx_px2 + mode->yy_px2), 0.0f)) : 0.0f;
  }

  const double width_, height_;  // of the monitor, px
  const int channel_;
  std::vector<float> samples_;                   // of one row
  std::array<float*, kPlanes.size()> planes_{};  // in samples_
  std::optional<ExrWriter> writer_;
};

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
  ChannelWeights weights;
  weights.add(matte, texture);
  return weights.strongest();
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
  GW_RETURN_IF_ERROR(check_monitor(matte.metadata, texture));
  std::optional<LightPaths> paths;
  if (path > 0) {
    paths.emplace(matte, texture);
    if (path > paths->count()) {
      return absl::InvalidArgumentError(fmt::format("path is {}; on monitor \"{}\" the matte has {}", path,
                                                    matte.metadata.monitors(texture).name(), paths->count()));
    }
  }
  return written_exr([&] {
    StmapWriter writer(matte.metadata, texture, channel, window_of(matte));
    writer.put(matte, [&](int x, int y, int c) {
      return paths ? paths->mode(x, y, c, path - 1) : strongest_mode(matte, x, y, c, texture);
    });
    return writer.finish();
  });
}

absl::StatusOr<WrittenStmap> write_stmap(std::string_view matte, const StmapChoice& choice,
                                         const fs::path& file) {
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(matte));
  GW_ASSIGN_OR_RETURN(const int texture, texture_named(outline.metadata, choice.monitor));
  GW_RETURN_IF_ERROR(check_monitor(outline.metadata, texture));
  WrittenStmap written{.monitor = outline.metadata.monitors(texture).name(),
                       .channel = choice.channel.value_or(0),
                       .width_px = outline.width_px,
                       .height_px = outline.height_px};
  if (!choice.channel) {
    ChannelWeights weights;
    GW_RETURN_IF_ERROR(for_rows_of_matte(matte, [&](const Matte& rows) {
      weights.add(rows, texture);
      return absl::OkStatus();
    }));
    written.channel = weights.strongest();
  }
  if (choice.path > 0) {
    GW_ASSIGN_OR_RETURN(const Matte whole, decode_matte(matte));
    GW_ASSIGN_OR_RETURN(const std::string bytes, encode_stmap(whole, texture, written.channel, choice.path));
    GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(file));
    GW_RETURN_IF_ERROR(writer.add(bytes));
    return written;
  }
  absl::Status rows_read;
  GW_RETURN_IF_ERROR(
      written_exr([&] {
        StmapWriter writer(outline.metadata, texture, written.channel, window_of(outline), file);
        rows_read = for_rows_of_matte(matte, [&](const Matte& rows) {
          return written_exr([&] {
                   writer.put(rows,
                              [&](int x, int y, int c) { return strongest_mode(rows, x, y, c, texture); });
                   return std::string();
                 })
              .status();
        });
        return writer.finish();
      }).status());
  GW_RETURN_IF_ERROR(rows_read);
  return written;
}

}  // namespace glasswing
