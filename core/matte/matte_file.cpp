#include "core/matte/matte_file.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/matte/exr_header.h"
#include "core/matte/exr_parts.h"

namespace glasswing {
namespace {

constexpr const char* kMetadata = "glasswing";
constexpr const char* kConventions = "glasswing:conventions";
constexpr const char* kChecksum = "glasswing:checksum";
constexpr const char* kConventionsText =
    "C = F + sum R integral G(x; c, S) T(x) dx per channel, linear light. Monitor px: origin at the outer "
    "corner of the top-left pixel, x right, y down, pixel centres at +0.5. S = [xx xy; xy yy] in px^2. G is "
    "a "
    "Gaussian, or where the attribute \"glasswing\" has footprint \"box\" an upright box. Of a mode, Y is "
    "the "
    "same in all colours. texture counts the monitors listed in that attribute.";
constexpr std::array<const char*, 3> kColours{"R", "G", "B"};
constexpr const char* kGray = "Y";
constexpr const char* kCoverage = "foreground.coverage.Y";
constexpr const char* kFlags = "foreground.flags.Y";

std::string foreground_name(size_t channel) {
  return fmt::format("foreground.F.{}", kColours[channel]);
}

class MemoryReader final : public Imf::IStream {
 public:
  explicit MemoryReader(std::string_view bytes) : IStream("matte"), bytes_(bytes) {}
  bool read(char c[], int n) override {
    const auto size = static_cast<size_t>(n);
    if (at_ > bytes_.size() || bytes_.size() - at_ < size) throw std::runtime_error("it ends too early");
    std::memcpy(c, bytes_.data() + at_, size);
    at_ += size;
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t position) override { at_ = position; }

 private:
  std::string_view bytes_;
  size_t at_ = 0;
};

struct ModeLayer {
  const char* name;
  float Mode::*member;  // null: the texture id
};
constexpr std::array<ModeLayer, 9> kModeLayers{{{"weight", &Mode::weight},
                                                {"x", &Mode::x_px},
                                                {"y", &Mode::y_px},
                                                {"xx", &Mode::xx_px2},
                                                {"xy", &Mode::xy_px2},
                                                {"yy", &Mode::yy_px2},
                                                {"texture", nullptr},
                                                {"weight_sd", &Mode::weight_sd},
                                                {"centre_sd", &Mode::centre_sd_px}}};

// "mode1.weight.R"; "mode1.weight.Y" where it is the same in all channels. A compositor knows a layer by its
// channels' names alone, so the part's is in them.
std::string channel_name(size_t mode, const ModeLayer& layer, int channel, bool colourless) {
  return fmt::format("mode{}.{}.{}", mode + 1, layer.name,
                     colourless ? kGray : kColours[static_cast<size_t>(channel)]);
}

std::vector<ExrPart> parts_of(const Matte& matte) {
  std::vector<ExrPart> parts;
  // For people: total weight and foreground, so that any viewer shows the object.
  ExrPart& preview = parts.emplace_back(ExrPart{"preview", {}});
  for (size_t c = 0; c < 3; ++c) {
    preview.planes.push_back(plane_of(matte, kColours[c], [&](int x, int y) {
      float light = matte.foreground(x, y)[c];
      for (const Mode& mode : matte.modes(x, y, static_cast<int>(c))) light += 0.5f * mode.weight;
      return light;
    }));
  }
  preview.planes.push_back(plane_of(matte, "A", [&](int x, int y) { return matte.coverage(x, y); }));
  ExrPart& foreground = parts.emplace_back(ExrPart{"foreground", {}});
  for (size_t c = 0; c < 3; ++c) {
    foreground.planes.push_back(
        plane_of(matte, foreground_name(c), [&](int x, int y) { return matte.foreground(x, y)[c]; }));
  }
  foreground.planes.push_back(plane_of(matte, kCoverage, [&](int x, int y) { return matte.coverage(x, y); }));
  foreground.planes.push_back(
      plane_of(matte, kFlags, [&](int x, int y) { return static_cast<float>(matte.flags(x, y)); }));
  for (size_t m = 0; m < static_cast<size_t>(matte.modes_per_channel()); ++m) {
    ExrPart& part = parts.emplace_back(ExrPart{fmt::format("mode{}", m + 1), {}});
    for (const ModeLayer& layer : kModeLayers) {
      for (int c = 0; c < (matte.is_colourless() ? 1 : 3); ++c) {
        part.planes.push_back(
            plane_of(matte, channel_name(m, layer, c, matte.is_colourless()), [&](int x, int y) {
              const Mode& mode = matte.modes(x, y, c)[m];
              return layer.member != nullptr ? mode.*layer.member : static_cast<float>(mode.texture);
            }));
      }
    }
  }
  return parts;
}

// Over the metadata and every plane, names included.
std::string checksum_over(const std::string& metadata, const std::vector<ExrPart>& parts) {
  std::string bytes = metadata;
  for (const ExrPart& part : parts) {
    bytes += part.name;
    for (const ExrPlane& plane : part.planes) {
      bytes += plane.name;
      bytes.append(reinterpret_cast<const char*>(plane.values.data()), plane.values.size() * sizeof(float));
    }
  }
  return checksum_of(bytes);
}

std::string json_of(const v1::MatteMetadata& metadata) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  (void)google::protobuf::util::MessageToJsonString(metadata, &json, options);
  return json;
}

absl::Status check(const Matte& matte) {
  const bool boxes = matte.metadata.footprint() == kBoxFootprint;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      bool good = std::isfinite(matte.coverage(x, y));
      for (int c = 0; c < 3; ++c) {
        good = good && std::isfinite(matte.foreground(x, y)[static_cast<size_t>(c)]);
        if (matte.is_colourless() && c > 0) continue;
        for (const Mode& mode : matte.modes(x, y, c)) {
          for (const ModeLayer& layer : kModeLayers) {
            good = good && (layer.member == nullptr || std::isfinite(mode.*layer.member));
          }
          good = good && mode.weight >= 0.0f && mode.weight_sd >= 0.0f && mode.centre_sd_px >= 0.0f &&
                 mode.xx_px2 >= 0.0f && mode.yy_px2 >= 0.0f && (!boxes || mode.xy_px2 == 0.0f) &&
                 mode.texture >= 0 && mode.texture < matte.metadata.monitors_size();
        }
      }
      if (!good)
        return absl::DataLossError(fmt::format("pixel ({}, {}) holds values that no matte has", x, y));
    }
  }
  return absl::OkStatus();
}

// Sorted, as EXR lists them.
std::vector<std::string> channels_of(int part, bool colourless) {
  std::vector<std::string> names;
  if (part == 0) names = {"R", "G", "B", "A"};
  if (part == 1) names = {foreground_name(0), foreground_name(1), foreground_name(2), kCoverage, kFlags};
  for (const ModeLayer& layer : kModeLayers) {
    for (int c = 0; part > 1 && c < (colourless ? 1 : kChannels); ++c)
      names.push_back(channel_name(static_cast<size_t>(part) - 2, layer, c, colourless));
  }
  std::ranges::sort(names);
  return names;
}

bool is_colourless(const Imf::MultiPartInputFile& file) {
  return file.header(2).channels().findChannel(channel_name(0, kModeLayers[0], 0, true)) != nullptr;
}

// The parts that a matte has, and no more pixels than so many bytes can hold: what is read afterwards is
// bounded by the file, whatever its header promises.
absl::Status check_parts(const Imf::MultiPartInputFile& file, size_t file_bytes) {
  if (file.parts() < 3 || file.parts() > 2 + kMaxModes)
    return absl::DataLossError("it has not the parts of a matte");
  const Imath::Box2i window = file.header(0).dataWindow();
  constexpr int kMaxSide = kMaxSide_px;
  if (window.isEmpty() || window.min.x < 0 || window.min.y < 0 || window.max.x >= kMaxSide ||
      window.max.y >= kMaxSide) {
    return absl::DataLossError("its size is out of range");
  }
  size_t layer_count = 0;
  const bool colourless = is_colourless(file);
  for (int i = 0; i < file.parts(); ++i) {
    const Imf::Header& header = file.header(i);
    if (header.dataWindow() != window) return absl::DataLossError("its parts differ in size");
    std::vector<std::string> layers;
    bool plain = header.compression() == Imf::ZIP_COMPRESSION && header.hasType() &&
                 header.type() == Imf::SCANLINEIMAGE;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      layers.emplace_back(channel.name());
      plain = plain && channel.channel().type == Imf::FLOAT && channel.channel().xSampling == 1 &&
              channel.channel().ySampling == 1;
    }
    if (!plain || layers != channels_of(i, colourless)) {
      return absl::DataLossError(fmt::format("its part {} has not the layers of a matte", i));
    }
    layer_count += layers.size();
  }
  const size_t pixels = static_cast<size_t>(window.max.x - window.min.x + 1) *
                        static_cast<size_t>(window.max.y - window.min.y + 1);
  constexpr size_t kMostExpansion = 1032;  // of deflate: 258 bytes for two bits
  if (pixels * layer_count * sizeof(float) / kMostExpansion > file_bytes) {
    return absl::DataLossError("it is too short for its size");
  }
  return absl::OkStatus();
}

absl::Status check_metadata(const v1::MatteMetadata& metadata, const Imath::Box2i& window) {
  if (metadata.format_version() > 1) {
    return absl::FailedPreconditionError(
        fmt::format("its format_version is {}; this program reads 1", metadata.format_version()));
  }
  const int width = metadata.width_px(), height = metadata.height_px();
  if (width < 1 || height < 1 || width > kMaxSide_px || height > kMaxSide_px || window.max.x >= width ||
      window.max.y >= height) {
    return absl::DataLossError(fmt::format("it is of a picture of {}x{} px, but has pixels up to ({}, {})",
                                           width, height, window.max.x, window.max.y));
  }
  if (metadata.monitors_size() > kMostMonitors) {
    return absl::DataLossError(
        fmt::format("it names {} monitors; at most {} can be", metadata.monitors_size(), kMostMonitors));
  }
  const std::string& footprint = metadata.footprint();
  if (!footprint.empty() && footprint != "gaussian" && footprint != kBoxFootprint) {
    return absl::FailedPreconditionError(
        fmt::format("its footprints are \"{}\"; this program reads \"gaussian\" and \"box\"", footprint));
  }
  return absl::OkStatus();
}

ExrPart read_part(Imf::MultiPartInputFile& file, int index) {
  const Imf::Header& header = file.header(index);
  const Imath::Box2i window = header.dataWindow();
  const size_t count = static_cast<size_t>(window.max.x - window.min.x + 1) *
                       static_cast<size_t>(window.max.y - window.min.y + 1);
  ExrPart part{.name = header.hasName() ? header.name() : "", .planes = {}};
  Imf::FrameBuffer buffer;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    ExrPlane& plane =
        part.planes.emplace_back(ExrPlane{.name = channel.name(), .values = std::vector<float>(count)});
    buffer.insert(plane.name, Imf::Slice::Make(Imf::FLOAT, plane.values.data(), window));
  }
  Imf::InputPart input(file, index);
  input.setFrameBuffer(buffer);
  input.readPixels(window.min.y, window.max.y);
  return part;
}

const ExrPlane& plane_named(const ExrPart& part, const std::string& name) {
  for (const ExrPlane& plane : part.planes) {
    if (plane.name == name) return plane;
  }
  throw std::runtime_error(fmt::format("part {} has no channel {}", part.name, name));
}

Matte matte_of(const std::vector<ExrPart>& parts, const Imath::Box2i& window, bool colourless) {
  const int width = window.max.x - window.min.x + 1;
  Matte matte(window.min.x, window.min.y, width, window.max.y - window.min.y + 1,
              static_cast<int>(parts.size()) - 2, colourless);
  const auto fill = [&](const ExrPart& part, const std::string& name, const auto& set) {
    const ExrPlane& plane = plane_named(part, name);
    for (size_t i = 0; i < plane.values.size(); ++i) {
      set(static_cast<int>(i) % width, static_cast<int>(i) / width, plane.values[i]);
    }
  };
  fill(parts[1], kCoverage, [&](int x, int y, float value) { matte.coverage(x, y) = value; });
  fill(parts[1], kFlags, [&](int x, int y, float value) {
    matte.flags(x, y) =
        value >= 0.0f && value <= 255.0f ? static_cast<std::uint8_t>(value) : std::uint8_t{kFlagNoData};
  });
  for (int c = 0; c < 3; ++c) {
    fill(parts[1], foreground_name(static_cast<size_t>(c)),
         [&](int x, int y, float value) { matte.foreground(x, y)[static_cast<size_t>(c)] = value; });
    if (colourless && c > 0) continue;
    for (size_t m = 0; m + 2 < parts.size(); ++m) {
      for (const ModeLayer& layer : kModeLayers) {
        fill(parts[m + 2], channel_name(m, layer, c, colourless), [&](int x, int y, float value) {
          Mode& mode = matte.modes(x, y, c)[m];
          if (layer.member != nullptr) {
            mode.*layer.member = value;
          } else {
            mode.texture = value >= 0.0f && value < 1024.0f ? static_cast<std::int32_t>(value) : -1;
          }
        });
      }
    }
  }
  return matte;
}

}  // namespace

absl::StatusOr<std::string> encode_matte(const Matte& matte, Packing packing) {
  std::vector<ExrPart> parts = parts_of(matte);
  // EXR lists channels by name, so the checksum is taken in that order.
  for (ExrPart& part : parts) std::ranges::sort(part.planes, {}, &ExrPlane::name);
  const std::string metadata = json_of(matte.metadata);
  return encode_exr(
      parts, matte,
      {{kMetadata, metadata}, {kConventions, kConventionsText}, {kChecksum, checksum_over(metadata, parts)}},
      packing == Packing::kQuick ? kQuickZip : kSmallZip);
}

absl::StatusOr<Matte> decode_matte(std::string_view bytes) {
  GW_RETURN_IF_ERROR(check_exr_header(bytes));
  try {
    MemoryReader reader(bytes);
    Imf::MultiPartInputFile file(reader, 1, false);
    GW_RETURN_IF_ERROR(check_parts(file, bytes.size()));
    const auto* metadata = file.header(0).findTypedAttribute<Imf::StringAttribute>(kMetadata);
    const auto* checksum = file.header(0).findTypedAttribute<Imf::StringAttribute>(kChecksum);
    if (metadata == nullptr || checksum == nullptr) return absl::DataLossError("it is no matte of ours");
    const Imath::Box2i window = file.header(0).dataWindow();
    std::vector<ExrPart> parts;
    for (int i = 0; i < file.parts(); ++i) parts.push_back(read_part(file, i));
    if (checksum_over(metadata->value(), parts) != checksum->value()) {
      return absl::DataLossError("its checksum does not agree with its pixels");
    }
    Matte matte = matte_of(parts, window, is_colourless(file));
    google::protobuf::util::JsonParseOptions options;
    options.ignore_unknown_fields = true;
    if (!google::protobuf::util::JsonStringToMessage(metadata->value(), &matte.metadata, options).ok()) {
      return absl::DataLossError("its metadata cannot be read");
    }
    GW_RETURN_IF_ERROR(check_metadata(matte.metadata, window));
    GW_RETURN_IF_ERROR(check(matte));
    return matte;
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("it is damaged or no matte: {}", error.what()));
  }
}

absl::StatusOr<Matte> read_matte(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  absl::StatusOr<Matte> matte = decode_matte(bytes);
  if (matte.ok()) return matte;
  return absl::Status(matte.status().code(),
                      fmt::format("{}: {}", path.string(), std::string(matte.status().message())));
}

absl::StatusOr<Matte> assemble(const std::vector<Matte>& tiles) {
  if (tiles.empty()) return absl::DataLossError("no tile has been solved");
  const v1::MatteMetadata& metadata = tiles.front().metadata;
  int modes = 1;
  std::vector<int> covered(static_cast<size_t>(std::max(metadata.height_px(), 0)), 0);
  for (const Matte& tile : tiles) {
    modes = std::max(modes, tile.modes_per_channel());
    if (tile.x0_px() < 0 || tile.y0_px() < 0 || tile.x0_px() + tile.width_px() > metadata.width_px() ||
        tile.y0_px() + tile.height_px() > metadata.height_px()) {
      return absl::DataLossError("a tile lies outside the camera's picture");
    }
    for (int y = 0; y < tile.height_px(); ++y) {
      covered[static_cast<size_t>(tile.y0_px() + y)] += tile.width_px();
    }
  }
  // Before the whole is allocated: it is no larger than its tiles.
  for (size_t y = 0; y < covered.size(); ++y) {
    if (covered[y] < metadata.width_px())
      return absl::DataLossError(fmt::format("no tile covers row {} whole", y));
  }
  const bool colourless = std::ranges::all_of(tiles, &Matte::is_colourless);
  Matte whole(0, 0, metadata.width_px(), metadata.height_px(), modes, colourless);
  whole.metadata = metadata;
  for (const Matte& tile : tiles) whole.put(tile);
  return whole;
}

}  // namespace glasswing
