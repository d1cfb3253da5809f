#include "core/matte/matte_file.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
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

namespace glasswing {
namespace {

constexpr const char* kMetadata = "glasswing";
constexpr const char* kConventions = "glasswing:conventions";
constexpr const char* kChecksum = "glasswing:checksum";
constexpr const char* kConventionsText =
    "C = F + sum R integral G(x; c, S) T(x) dx per channel, linear light. Monitor px: origin at the outer "
    "corner of "
    "the top-left pixel, x right, y down, pixel centres at +0.5. S = [xx xy; xy yy] in px^2. G is a "
    "Gaussian, "
    "or where the attribute \"glasswing\" has footprint \"box\" an upright box. Layers of modes "
    "without a colour are the same in all. texture counts the "
    "monitors listed in that attribute.";
constexpr std::array<const char*, 3> kColours{"R", "G", "B"};

// One layer of one part: its name and its pixels, row by row.
struct Plane {
  std::string name;
  std::vector<float> values;
};
struct Part {
  std::string name;
  std::vector<Plane> planes;
};

class MemoryWriter final : public Imf::OStream {
 public:
  MemoryWriter() : OStream("matte") {}
  void write(const char c[], int n) override {
    const auto size = static_cast<size_t>(n);
    if (bytes.size() < at_ + size) bytes.resize(at_ + size);
    std::memcpy(&bytes[at_], c, size);
    at_ += size;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t position) override { at_ = position; }
  std::string bytes;

 private:
  size_t at_ = 0;
};

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

template <typename Get>
Plane plane_of(const Matte& matte, std::string name, const Get& get) {
  Plane plane{.name = std::move(name), .values = {}};
  plane.values.reserve(static_cast<size_t>(matte.width_px()) * static_cast<size_t>(matte.height_px()));
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) plane.values.push_back(get(x, y));
  }
  return plane;
}

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

// "weight.R"; "weight" where it is the same in all channels.
std::string layer_name(const ModeLayer& layer, int channel, bool colourless) {
  return colourless ? layer.name : fmt::format("{}.{}", layer.name, kColours[static_cast<size_t>(channel)]);
}

std::vector<Part> parts_of(const Matte& matte) {
  std::vector<Part> parts;
  // For people: total weight and foreground, so that any viewer shows the object.
  Part& preview = parts.emplace_back(Part{"preview", {}});
  for (size_t c = 0; c < 3; ++c) {
    preview.planes.push_back(plane_of(matte, kColours[c], [&](int x, int y) {
      float light = matte.foreground(x, y)[c];
      for (const Mode& mode : matte.modes(x, y, static_cast<int>(c))) light += 0.5f * mode.weight;
      return light;
    }));
  }
  preview.planes.push_back(plane_of(matte, "A", [&](int x, int y) { return matte.coverage(x, y); }));
  Part& foreground = parts.emplace_back(Part{"foreground", {}});
  for (size_t c = 0; c < 3; ++c) {
    foreground.planes.push_back(plane_of(matte, fmt::format("F.{}", kColours[c]),
                                         [&](int x, int y) { return matte.foreground(x, y)[c]; }));
  }
  foreground.planes.push_back(
      plane_of(matte, "coverage", [&](int x, int y) { return matte.coverage(x, y); }));
  foreground.planes.push_back(
      plane_of(matte, "flags", [&](int x, int y) { return static_cast<float>(matte.flags(x, y)); }));
  for (int m = 0; m < matte.modes_per_channel(); ++m) {
    Part& part = parts.emplace_back(Part{fmt::format("mode{}", m + 1), {}});
    for (const ModeLayer& layer : kModeLayers) {
      for (int c = 0; c < (matte.is_colourless() ? 1 : 3); ++c) {
        part.planes.push_back(plane_of(matte, layer_name(layer, c, matte.is_colourless()), [&](int x, int y) {
          const Mode& mode = matte.modes(x, y, c)[static_cast<size_t>(m)];
          return layer.member != nullptr ? mode.*layer.member : static_cast<float>(mode.texture);
        }));
      }
    }
  }
  return parts;
}

// Over the metadata and every plane, names included.
std::string checksum_over(const std::string& metadata, const std::vector<Part>& parts) {
  std::string bytes = metadata;
  for (const Part& part : parts) {
    bytes += part.name;
    for (const Plane& plane : part.planes) {
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

Imf::FrameBuffer buffer_over(std::vector<Plane>& planes, const Imath::Box2i& window) {
  const auto width = static_cast<size_t>(window.max.x - window.min.x + 1);
  Imf::FrameBuffer buffer;
  for (Plane& plane : planes) {
    buffer.insert(plane.name, Imf::Slice::Make(Imf::FLOAT, plane.values.data(), window, sizeof(float),
                                               width * sizeof(float)));
  }
  return buffer;
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

std::vector<std::string> layers_of_mode(bool colourless) {
  std::vector<std::string> layers;
  for (const ModeLayer& layer : kModeLayers) {
    for (int c = 0; c < (colourless ? 1 : 3); ++c) layers.push_back(layer_name(layer, c, colourless));
  }
  return layers;
}

// Sorted, as EXR lists them.
std::vector<std::string> layers_of(int part, bool colourless) {
  std::vector<std::string> layers = part == 0 ? std::vector<std::string>{"R", "G", "B", "A"}
                                    : part == 1
                                        ? std::vector<std::string>{"F.R", "F.G", "F.B", "coverage", "flags"}
                                        : layers_of_mode(colourless);
  std::sort(layers.begin(), layers.end());
  return layers;
}

// Walks over the headers alone. OpenEXR believes what an attribute says of its size and allocates it before
// it reads; ours must be of the types that a matte has, be as long as those are, and lie within the file, and
// so must every part's table of chunks.
class HeaderWalk {
 public:
  explicit HeaderWalk(std::string_view bytes) : bytes_(bytes) {}

  absl::Status check() {
    while (true) {
      std::string_view name;
      if (!take_name(&name)) return damaged();
      if (name.empty()) break;  // no attribute: the last header is past
      for (; !name.empty();) {
        if (!take_attribute(name) || !take_name(&name)) return damaged();
      }
    }
    return chunk_count_ <= static_cast<std::int64_t>(bytes_.size() / 8) ? absl::OkStatus() : damaged();
  }

 private:
  static absl::Status damaged() {
    return absl::DataLossError("it is damaged or no matte: its header is none of a matte's");
  }

  bool take(size_t size, std::string_view* taken) {
    if (at_ > bytes_.size() || bytes_.size() - at_ < size) return false;
    *taken = bytes_.substr(at_, size);
    at_ += size;
    return true;
  }
  bool take_int(std::int32_t* value) {
    std::string_view taken;
    if (!take(sizeof *value, &taken)) return false;
    std::memcpy(value, taken.data(), sizeof *value);
    return true;
  }
  bool take_name(std::string_view* name) {
    constexpr size_t kLongest = 255;
    const size_t end = at_ < bytes_.size() ? bytes_.find('\0', at_) : std::string_view::npos;
    return end != std::string_view::npos && end - at_ <= kLongest && take(end - at_, name) && ++at_ > 0;
  }
  // A list of channels ends with an empty name, and nothing comes after it.
  bool take_channels(size_t size) {
    const size_t end = at_ + size;
    constexpr size_t kAfterName = 16;
    for (std::string_view name, rest; take_name(&name) && at_ <= end;) {
      if (name.empty()) return at_ == end;
      if (!take(kAfterName, &rest)) break;
    }
    return false;
  }
  bool take_attribute(std::string_view name) {
    struct Type {
      std::string_view name;
      std::int32_t size;
    };
    constexpr std::array<Type, 6> kTypes{
        {{"box2i", 16}, {"compression", 1}, {"float", 4}, {"int", 4}, {"lineOrder", 1}, {"v2f", 8}}};
    std::string_view type, value;
    std::int32_t size = 0;
    if (!take_name(&type) || !take_int(&size) || size < 0) return false;
    if (type == "chlist") return take_channels(static_cast<size_t>(size));
    const size_t start = at_;
    if (!take(static_cast<size_t>(size), &value)) return false;
    if (type == "string") return true;
    const auto known = std::ranges::find(kTypes, type, &Type::name);
    if (known == kTypes.end() || known->size != size) return false;
    if (name == "chunkCount") {
      std::int32_t count = 0;
      std::memcpy(&count, &bytes_[start], sizeof count);
      if (type != "int" || count < 0) return false;
      chunk_count_ += count;
    }
    return true;
  }

  const std::string_view bytes_;
  size_t at_ = 8;  // past magic number and version
  std::int64_t chunk_count_ = 0;
};

bool is_colourless(const Imf::MultiPartInputFile& file) {
  return file.header(2).channels().findChannel(kModeLayers[0].name) != nullptr;
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
    if (!plain || layers != layers_of(i, colourless)) {
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

Part read_part(Imf::MultiPartInputFile& file, int index) {
  const Imf::Header& header = file.header(index);
  const Imath::Box2i window = header.dataWindow();
  const size_t count = static_cast<size_t>(window.max.x - window.min.x + 1) *
                       static_cast<size_t>(window.max.y - window.min.y + 1);
  Part part{.name = header.hasName() ? header.name() : "", .planes = {}};
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    part.planes.push_back({.name = channel.name(), .values = std::vector<float>(count)});
  }
  Imf::InputPart input(file, index);
  input.setFrameBuffer(buffer_over(part.planes, window));
  input.readPixels(window.min.y, window.max.y);
  return part;
}

const Plane& plane_named(const Part& part, const std::string& name) {
  for (const Plane& plane : part.planes) {
    if (plane.name == name) return plane;
  }
  throw std::runtime_error(fmt::format("part {} has no layer {}", part.name, name));
}

Matte matte_of(const std::vector<Part>& parts, const Imath::Box2i& window, bool colourless) {
  const int width = window.max.x - window.min.x + 1;
  Matte matte(window.min.x, window.min.y, width, window.max.y - window.min.y + 1,
              static_cast<int>(parts.size()) - 2, colourless);
  const auto fill = [&](const Part& part, const std::string& name, const auto& set) {
    const Plane& plane = plane_named(part, name);
    for (size_t i = 0; i < plane.values.size(); ++i) {
      set(static_cast<int>(i) % width, static_cast<int>(i) / width, plane.values[i]);
    }
  };
  fill(parts[1], "coverage", [&](int x, int y, float value) { matte.coverage(x, y) = value; });
  fill(parts[1], "flags", [&](int x, int y, float value) {
    matte.flags(x, y) =
        value >= 0.0f && value <= 255.0f ? static_cast<std::uint8_t>(value) : std::uint8_t{kFlagNoData};
  });
  for (int c = 0; c < 3; ++c) {
    const std::string colour = kColours[static_cast<size_t>(c)];
    fill(parts[1], "F." + colour,
         [&](int x, int y, float value) { matte.foreground(x, y)[static_cast<size_t>(c)] = value; });
    if (colourless && c > 0) continue;
    for (int m = 0; m < matte.modes_per_channel(); ++m) {
      for (const ModeLayer& layer : kModeLayers) {
        fill(parts[static_cast<size_t>(m) + 2], layer_name(layer, c, colourless),
             [&](int x, int y, float value) {
               Mode& mode = matte.modes(x, y, c)[static_cast<size_t>(m)];
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

absl::StatusOr<std::string> encode_matte(const Matte& matte) {
  try {
    std::vector<Part> parts = parts_of(matte);
    // EXR lists layers by name, so the checksum is taken in that order.
    for (Part& part : parts) {
      std::sort(part.planes.begin(), part.planes.end(),
                [](const Plane& a, const Plane& b) { return a.name < b.name; });
    }
    const std::string metadata = json_of(matte.metadata);
    const Imath::Box2i window({matte.x0_px(), matte.y0_px()},
                              {matte.x0_px() + matte.width_px() - 1, matte.y0_px() + matte.height_px() - 1});
    const int full_width = std::max(matte.metadata.width_px(), matte.x0_px() + matte.width_px());
    const int full_height = std::max(matte.metadata.height_px(), matte.y0_px() + matte.height_px());
    std::vector<Imf::Header> headers;
    for (const Part& part : parts) {
      Imf::Header header(Imath::Box2i({0, 0}, {full_width - 1, full_height - 1}), window);
      header.compression() = Imf::ZIP_COMPRESSION;
      header.setType(Imf::SCANLINEIMAGE);
      header.setName(part.name);
      header.insert(kMetadata, Imf::StringAttribute(metadata));
      header.insert(kConventions, Imf::StringAttribute(kConventionsText));
      header.insert(kChecksum, Imf::StringAttribute(checksum_over(metadata, parts)));
      for (const Plane& plane : part.planes) header.channels().insert(plane.name, Imf::Channel(Imf::FLOAT));
      headers.push_back(std::move(header));
    }
    MemoryWriter writer;
    {
      Imf::MultiPartOutputFile file(writer, headers.data(), static_cast<int>(headers.size()));
      for (size_t i = 0; i < parts.size(); ++i) {
        Imf::OutputPart part(file, static_cast<int>(i));
        part.setFrameBuffer(buffer_over(parts[i].planes, window));
        part.writePixels(matte.height_px());
      }
    }
    return std::move(writer.bytes);
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("the matte cannot be written: {}", error.what()));
  }
}

absl::StatusOr<Matte> decode_matte(std::string_view bytes) {
  GW_RETURN_IF_ERROR(HeaderWalk(bytes).check());
  try {
    MemoryReader reader(bytes);
    Imf::MultiPartInputFile file(reader, 1, false);
    GW_RETURN_IF_ERROR(check_parts(file, bytes.size()));
    const auto* metadata = file.header(0).findTypedAttribute<Imf::StringAttribute>(kMetadata);
    const auto* checksum = file.header(0).findTypedAttribute<Imf::StringAttribute>(kChecksum);
    if (metadata == nullptr || checksum == nullptr) return absl::DataLossError("it is no matte of ours");
    const Imath::Box2i window = file.header(0).dataWindow();
    std::vector<Part> parts;
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
