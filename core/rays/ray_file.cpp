#include "core/rays/ray_file.h"

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

#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/matte/exr_header.h"
#include "core/matte/exr_writer.h"

namespace glasswing {
namespace {

constexpr const char* kRayMetadata = "glasswing:rays";
constexpr const char* kRayConventions = "glasswing:conventions";
constexpr const char* kRayChecksum = "glasswing:checksum";
constexpr const char* kRayConventionsText =
    "C = F + sum weight * light of a bundle of rays, per channel, linear light. A bundle: origin + u "
    "origin_u + v "
    "origin_v, direction + u direction_u + v direction_v, u and v independent with standard deviation 1. mm, "
    "in "
    "the camera's frame: origin at the centre of projection, x right, y down, z forward. state: 0 matched, 1 "
    "ambiguous, 2 extrapolated, 3 unknown, 4 straight, 5 far light. Layer ray: green's strongest ray.";
constexpr std::array<const char*, kChannels> kRayColours{"R", "G", "B"};
constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};
constexpr int kStrongestChannel = 1;

// The numbers of a ray in the order of the file's channels, which OpenEXR sorts by name.
struct RayLayer {
  const char* name;
  float (*get)(const Ray&);
  void (*set)(Ray&, float);
};
template <auto Vector, int Axis>
float get_axis(const Ray& ray) {
  return (ray.*Vector)[Axis];
}
template <auto Vector, int Axis>
void set_axis(Ray& ray, float value) {
  (ray.*Vector)[Axis] = value;
}
template <auto Spread, size_t Which, int Axis>
float get_spread(const Ray& ray) {
  return (ray.*Spread)[Which][Axis];
}
template <auto Spread, size_t Which, int Axis>
void set_spread(Ray& ray, float value) {
  (ray.*Spread)[Which][Axis] = value;
}
#define RAY_VECTOR(name, member)                                           \
  {name "_x", get_axis<&Ray::member, 0>, set_axis<&Ray::member, 0>},       \
      {name "_y", get_axis<&Ray::member, 1>, set_axis<&Ray::member, 1>}, { \
    name "_z", get_axis<&Ray::member, 2>, set_axis<&Ray::member, 2>        \
  }
#define RAY_SPREAD(name, member, which)                                                      \
  {name "_x", get_spread<&Ray::member, which, 0>, set_spread<&Ray::member, which, 0>},       \
      {name "_y", get_spread<&Ray::member, which, 1>, set_spread<&Ray::member, which, 1>}, { \
    name "_z", get_spread<&Ray::member, which, 2>, set_spread<&Ray::member, which, 2>        \
  }
const std::vector<RayLayer>& ray_layers() {
  static const std::vector<RayLayer> layers{
      {"weight", [](const Ray& ray) { return ray.weight; },
       [](Ray& ray, float value) { ray.weight = value; }},
      RAY_VECTOR("origin", origin_mm),
      RAY_VECTOR("direction", direction),
      RAY_SPREAD("origin_u", origin_spread_mm, 0),
      RAY_SPREAD("origin_v", origin_spread_mm, 1),
      RAY_SPREAD("direction_u", direction_spread, 0),
      RAY_SPREAD("direction_v", direction_spread, 1),
      {"origin_sd", [](const Ray& ray) { return ray.origin_sd_mm; },
       [](Ray& ray, float value) { ray.origin_sd_mm = value; }},
      {"direction_sd", [](const Ray& ray) { return ray.direction_sd; },
       [](Ray& ray, float value) { ray.direction_sd = value; }},
      {"state", [](const Ray& ray) { return static_cast<float>(ray.state); },
       [](Ray& ray, float value) { ray.state = static_cast<RayState>(static_cast<std::uint8_t>(value)); }},
  };
  return layers;
}
#undef RAY_VECTOR
#undef RAY_SPREAD

std::string ray_channel(int ray, const char* layer, int channel) {
  return fmt::format("ray{}.{}.{}", ray + 1, layer, kRayColours[channel]);
}

const Ray* strongest_of(const RayMatte& rays, int x, int y) {
  const Ray* strongest = nullptr;
  for (const Ray& ray : rays.rays(x, y, kStrongestChannel)) {
    if (ray.weight > 0.0f && (strongest == nullptr || ray.weight > strongest->weight)) strongest = &ray;
  }
  return strongest;
}

// Visits every channel of every part: use(part's name, channel's name, get(x, y), set(x, y, value)).
template <class Matte, class Use>
void for_channels(Matte& rays, const Use& use) {
  const auto none = [](int, int, float) {};
  for (int c = 0; c < kChannels; ++c) {
    const size_t index = c;
    use(
        "preview", std::string(kRayColours[index]),
        [&, c](int x, int y) {
          float light = rays.foreground(x, y)[c];
          for (const Ray& ray : rays.rays(x, y, c)) light += 0.5f * ray.weight;
          return light;
        },
        none);
  }
  use(
      "preview", "A", [&](int x, int y) { return rays.coverage(x, y); }, none);
  for (int c = 0; c < kChannels; ++c) {
    use(
        "foreground", fmt::format("foreground.F.{}", kRayColours[c]),
        [&, c](int x, int y) { return rays.foreground(x, y)[c]; },
        [&, c](int x, int y, float value) {
          if constexpr (!std::is_const_v<Matte>) rays.foreground(x, y)[c] = value;
        });
  }
  use(
      "foreground", "foreground.coverage.Y", [&](int x, int y) { return rays.coverage(x, y); },
      [&](int x, int y, float value) {
        if constexpr (!std::is_const_v<Matte>) rays.coverage(x, y) = value;
      });
  use(
      "foreground", "foreground.flags.Y", [&](int x, int y) { return static_cast<float>(rays.flags(x, y)); },
      [&](int x, int y, float value) {
        if constexpr (!std::is_const_v<Matte>) rays.flags(x, y) = static_cast<std::uint8_t>(value);
      });
  const auto strongest = [&](const std::string& name, auto get) {
    use(
        "ray", name,
        [&, get](int x, int y) {
          const Ray* ray = strongest_of(rays, x, y);
          return ray != nullptr ? get(*ray) : 0.0f;
        },
        none);
  };
  for (int axis = 0; axis < 3; ++axis) {
    const char name = static_cast<char>('X' + axis);
    strongest(fmt::format("ray.origin.{}", name), [axis](const Ray& ray) { return ray.origin_mm[axis]; });
    strongest(fmt::format("ray.direction.{}", name), [axis](const Ray& ray) { return ray.direction[axis]; });
  }
  strongest("ray.weight.Y", [](const Ray& ray) { return ray.weight; });
  strongest("ray.state.Y", [](const Ray& ray) { return static_cast<float>(ray.state); });
  for (int r = 0; r < rays.rays_per_channel(); ++r) {
    for (const RayLayer& layer : ray_layers()) {
      for (int c = 0; c < kChannels; ++c) {
        use(
            fmt::format("ray{}", r + 1), ray_channel(r, layer.name, c),
            [&, r, c](int x, int y) { return layer.get(rays.rays(x, y, c)[r]); },
            [&, r, c](int x, int y, float value) {
              if constexpr (!std::is_const_v<Matte>) layer.set(rays.rays(x, y, c)[r], value);
            });
      }
    }
  }
}

// The names of all parts and channels, sorted within a part.
template <class Matte>
std::vector<ExrPart> ray_parts(Matte& rays) {
  std::vector<ExrPart> parts;
  for_channels(rays, [&](const std::string& part, const std::string& channel, const auto&, const auto&) {
    if (parts.empty() || parts.back().name != part)
      parts.push_back({.name = part, .channels = {}, .attributes = {}});
    parts.back().channels.push_back(channel);
  });
  for (ExrPart& part : parts) std::ranges::sort(part.channels);
  return parts;
}

using RayPixels = std::vector<std::vector<std::vector<float>>>;  // by part and channel

std::string checksum_of_rays(const std::string& metadata, const std::vector<ExrPart>& parts,
                             const RayPixels& pixels) {
  RunningChecksum checksum;
  checksum.add(metadata);
  for (size_t p = 0; p < parts.size(); ++p) {
    checksum.add(parts[p].name);
    for (size_t c = 0; c < parts[p].channels.size(); ++c) {
      checksum.add(parts[p].channels[c]);
      checksum.add({reinterpret_cast<const char*>(pixels[p][c].data()), pixels[p][c].size() * sizeof(float)});
    }
  }
  return checksum.text();
}

class RayBytes final : public Imf::IStream {
 public:
  explicit RayBytes(std::string_view bytes) : IStream("rays"), bytes_(bytes) {}
  bool read(char c[], int n) override {
    const size_t size = n;
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

std::string text_of(const Imf::Header& header, const char* name) {
  const auto* text = header.findTypedAttribute<Imf::StringAttribute>(name);
  return text != nullptr ? text->value() : std::string();
}

absl::Status check_rays(const RayMatte& rays) {
  constexpr float kMaxUnitError = 1e-3f;
  for (int y = 0; y < rays.height_px(); ++y) {
    for (int x = 0; x < rays.width_px(); ++x) {
      bool good = std::isfinite(rays.coverage(x, y));
      for (int c = 0; c < kChannels; ++c) {
        good = good && std::isfinite(rays.foreground(x, y)[c]);
        for (const Ray& ray : rays.rays(x, y, c)) {
          for (const RayLayer& layer : ray_layers()) good = good && std::isfinite(layer.get(ray));
          good = good && ray.weight >= 0.0f && ray.state <= RayState::kFarLight &&
                 (!(ray.weight > 0.0f) || std::abs(ray.direction.norm() - 1.0f) < kMaxUnitError);
        }
      }
      if (!good)
        return absl::DataLossError(fmt::format("pixel ({}, {}) has values that are invalid in rays", x, y));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<RayMatte> decode_checked(std::string_view bytes) {
  RayBytes stream(bytes);
  Imf::MultiPartInputFile file(stream, 1, false);
  const std::string json = text_of(file.header(0), kRayMetadata);
  v1::RayMetadata metadata;
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  if (json.empty() || !google::protobuf::util::JsonStringToMessage(json, &metadata, options).ok())
    return absl::DataLossError("it is not a file of rays");
  if (metadata.format_version() > 1) {
    return absl::FailedPreconditionError(
        fmt::format("its format_version is {}; this program reads 1", metadata.format_version()));
  }
  const Imath::Box2i window = file.header(0).dataWindow();
  constexpr int kNamedParts = 3, kMaxSide = kMaxSide_px;
  const int count = file.parts() - kNamedParts, width = window.max.x + 1, height = window.max.y + 1;
  if (count < 1 || count > kMaxModes || window.min.x != 0 || window.min.y != 0 || width < 1 || height < 1 ||
      width > kMaxSide || height > kMaxSide) {
    return absl::DataLossError("its parts or its size are not those of a file of rays");
  }
  // Before memory is allocated for what the header declares: deflate makes at most 258 bytes of two bits.
  constexpr size_t kMaxExpansion = 1032;
  const size_t area = static_cast<size_t>(width) * height;
  if (area * static_cast<size_t>(count) * ray_layers().size() * kChannels * sizeof(float) / kMaxExpansion >
      bytes.size()) {
    return absl::DataLossError("it is too short for its size");
  }
  RayMatte rays(width, height, count);
  rays.metadata = metadata;
  const std::vector<ExrPart> parts = ray_parts(rays);
  RayPixels pixels(parts.size());
  for (size_t p = 0; p < parts.size(); ++p) {
    const Imf::Header& header = file.header(static_cast<int>(p));
    std::vector<std::string> channels;
    bool plain = header.dataWindow() == window && header.type() == Imf::SCANLINEIMAGE;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      channels.emplace_back(channel.name());
      plain = plain && channel.channel().type == Imf::FLOAT && channel.channel().xSampling == 1 &&
              channel.channel().ySampling == 1;
    }
    if (!plain || header.name() != parts[p].name || channels != parts[p].channels)
      return absl::DataLossError(fmt::format("its part {} does not have the layers of rays", p));
    Imf::FrameBuffer buffer;
    pixels[p].resize(channels.size());
    for (size_t c = 0; c < channels.size(); ++c) {
      pixels[p][c].resize(area);
      buffer.insert(channels[c], Imf::Slice::Make(Imf::FLOAT, pixels[p][c].data(), window));
    }
    Imf::InputPart input(file, static_cast<int>(p));
    input.setFrameBuffer(buffer);
    input.readPixels(0, height - 1);
  }
  if (checksum_of_rays(json, parts, pixels) != text_of(file.header(0), kRayChecksum))
    return absl::DataLossError("its pixels do not agree with its checksum");
  for_channels(rays, [&](const std::string& part, const std::string& channel, const auto&, const auto& set) {
    const auto p = std::ranges::find(parts, part, &ExrPart::name) - parts.begin();
    const std::vector<std::string>& names = parts[p].channels;
    const auto c = std::ranges::lower_bound(names, channel) - names.begin();
    const std::vector<float>& plane = pixels[p][c];
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) set(x, y, plane[static_cast<size_t>(y) * width + x]);
    }
  });
  GW_RETURN_IF_ERROR(check_rays(rays));
  return rays;
}

}  // namespace

absl::StatusOr<std::string> encode_rays(const RayMatte& rays) {
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  if (!google::protobuf::util::MessageToJsonString(rays.metadata, &json, options).ok())
    return absl::InternalError("the metadata of the rays cannot be written");
  std::vector<ExrPart> parts = ray_parts(rays);
  RayPixels pixels(parts.size());
  for (size_t p = 0; p < parts.size(); ++p) pixels[p].resize(parts[p].channels.size());
  for_channels(rays, [&](const std::string& part, const std::string& channel, const auto& get, const auto&) {
    const auto p = std::ranges::find(parts, part, &ExrPart::name) - parts.begin();
    const std::vector<std::string>& names = parts[p].channels;
    const auto c = std::ranges::lower_bound(names, channel) - names.begin();
    std::vector<float>& plane = pixels[p][c];
    for (int y = 0; y < rays.height_px(); ++y) {
      for (int x = 0; x < rays.width_px(); ++x) plane.push_back(get(x, y));
    }
  });
  for (ExrPart& part : parts) part.attributes[kRayConventions] = kRayConventionsText;
  parts[0].attributes[kRayMetadata] = json;
  parts[0].attributes[kRayChecksum] = checksum_of_rays(json, parts, pixels);
  return written_exr([&] {
    ExrWriter writer(parts, {.x0_px = 0,
                             .y0_px = 0,
                             .width_px = rays.width_px(),
                             .height_px = rays.height_px(),
                             .picture_width_px = rays.width_px(),
                             .picture_height_px = rays.height_px()});
    for (int y = 0; y < rays.height_px(); ++y) {
      for (size_t p = 0; p < parts.size(); ++p) {
        std::vector<const float*> row;
        for (const std::vector<float>& plane : pixels[p])
          row.push_back(plane.data() + static_cast<size_t>(y) * rays.width_px());
        writer.put(p, row);
      }
    }
    return writer.finish();
  });
}

absl::StatusOr<RayMatte> decode_rays(std::string_view bytes) {
  GW_RETURN_IF_ERROR(check_exr_header(bytes).status());
  try {
    return decode_checked(bytes);
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("it is damaged or not a file of rays: {}", error.what()));
  }
}

absl::StatusOr<RayMatte> read_rays(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  absl::StatusOr<RayMatte> rays = decode_rays(bytes);
  if (!rays.ok()) {
    return absl::Status(rays.status().code(),
                        fmt::format("{}: {}", path.string(), std::string(rays.status().message())));
  }
  return rays;
}

bool is_ray_file(std::string_view bytes) {
  constexpr size_t kHead = 65536;
  return bytes.substr(0, kHead).find(kRayMetadata) != std::string_view::npos;
}

}  // namespace glasswing
