#include "compositing/deliver/cryptomatte.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/status.h"
#include "core/matte/exr_writer.h"
#include "core/matte/matte_layers.h"

namespace glasswing {
namespace {

constexpr const char* kLayer = kIdsPart;
constexpr int kPerLayer = 2;  // pairs of id and share, in R G and B A
constexpr std::array<const char*, 4> kColours{"R", "G", "B", "A"};

absl::Status check(std::span<const ObjectShares> objects, size_t pixels) {
  if (objects.empty()) return absl::InvalidArgumentError("there is no object to tell from others");
  std::set<std::string> names;
  std::set<std::uint32_t> ids;
  for (const ObjectShares& object : objects) {
    if (object.name.empty()) return absl::InvalidArgumentError("an object has no name");
    if (object.share.size() != pixels)
      return absl::InvalidArgumentError(fmt::format("object \"{}\" has {} pixels; the picture has {}",
                                                    object.name, object.share.size(), pixels));
    if (!names.insert(object.name).second)
      return absl::InvalidArgumentError(fmt::format("two objects are named \"{}\"", object.name));
    if (!ids.insert(cryptomatte_id(object.name)).second)
      return absl::InvalidArgumentError(
          fmt::format("\"{}\" has the id of another name; one must be called differently", object.name));
  }
  return absl::OkStatus();
}

// The pairs of each pixel, as the planes of the file's layers; the last plane is the coverage of all.
std::vector<std::vector<float>> planes_of(std::span<const ObjectShares> objects, int layers, size_t pixels) {
  std::vector<std::vector<float>> planes(static_cast<size_t>(layers) * kColours.size() + 1,
                                         std::vector<float>(pixels));
  std::vector<std::pair<float, float>> pairs;  // share, id
  for (size_t i = 0; i < pixels; ++i) {
    pairs.clear();
    for (const ObjectShares& object : objects) {
      const float share = object.share[i];
      if (share > 0.0f) pairs.emplace_back(share, std::bit_cast<float>(cryptomatte_id(object.name)));
      planes.back()[i] += std::max(share, 0.0f);
    }
    std::ranges::stable_sort(pairs, std::greater(), &std::pair<float, float>::first);
    for (size_t rank = 0; rank < std::min(pairs.size(), static_cast<size_t>(layers * kPerLayer)); ++rank) {
      planes[2 * rank][i] = pairs[rank].second;
      planes[2 * rank + 1][i] = pairs[rank].first;
    }
  }
  return planes;
}

void describe(Imf::Header& header, std::span<const ObjectShares> objects) {
  nlohmann::json manifest = nlohmann::json::object();
  for (const ObjectShares& object : objects)
    manifest[object.name] = fmt::format("{:08x}", cryptomatte_id(object.name));
  const std::string key =
      fmt::format("cryptomatte/{}/", fmt::format("{:08x}", murmur3_32(kLayer)).substr(0, 7));
  for (const auto& [name, text] : {std::pair<std::string, std::string>{"name", kLayer},
                                   {"hash", "MurmurHash3_32"},
                                   {"conversion", "uint32_to_float32"},
                                   {"manifest", manifest.dump()}})
    header.insert(key + name, Imf::StringAttribute(text));
}

}  // namespace

std::uint32_t murmur3_32(std::string_view text) {
  constexpr std::uint32_t kFirst = 0xcc9e2d51u, kSecond = 0x1b873593u;
  const auto mixed = [](std::uint32_t word) { return std::rotl(word * kFirst, 15) * kSecond; };
  std::uint32_t hash = 0;
  size_t at = 0;
  for (; at + 4 <= text.size(); at += 4) {
    std::uint32_t word = 0;
    for (size_t i = 0; i < 4; ++i) word |= std::uint32_t{static_cast<unsigned char>(text[at + i])} << 8 * i;
    hash = std::rotl(hash ^ mixed(word), 13) * 5 + 0xe6546b64u;
  }
  std::uint32_t rest = 0;
  for (size_t i = 0; at + i < text.size(); ++i)
    rest |= std::uint32_t{static_cast<unsigned char>(text[at + i])} << 8 * i;
  hash ^= mixed(rest) ^ static_cast<std::uint32_t>(text.size());
  hash = (hash ^ hash >> 16) * 0x85ebca6bu;
  hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
  return hash ^ hash >> 16;
}

std::uint32_t cryptomatte_id(std::string_view name) {
  const std::uint32_t hash = murmur3_32(name), exponent = hash >> 23 & 0xffu;
  return exponent == 0 || exponent == 0xffu ? hash ^ 1u << 23 : hash;
}

absl::StatusOr<std::string> encode_cryptomatte(std::span<const ObjectShares> objects, int width_px,
                                               int height_px) {
  const size_t pixels = static_cast<size_t>(width_px) * height_px;
  GW_RETURN_IF_ERROR(check(objects, pixels));
  const int layers =
      std::min((static_cast<int>(objects.size()) + kPerLayer - 1) / kPerLayer, kMaxCryptomatteLayers);
  const std::vector<std::vector<float>> planes = planes_of(objects, layers, pixels);
  return written_exr([&] {
    Imf::Header header(width_px, height_px);
    header.compression() = Imf::ZIP_COMPRESSION;
    describe(header, objects);
    header.insert("colorInteropID", Imf::StringAttribute("data"));
    Imf::FrameBuffer buffer;
    const auto add = [&](const std::string& channel, const std::vector<float>& plane) {
      header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
      buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, plane.data(), header.dataWindow()));
    };
    for (int layer = 0; layer < layers; ++layer) {
      for (size_t c = 0; c < kColours.size(); ++c)
        add(fmt::format("{}{:02}.{}", kLayer, layer, kColours[c]),
            planes[static_cast<size_t>(layer) * kColours.size() + c]);
    }
    for (const char* channel : {"R", "G", "B", "A"}) add(channel, planes.back());
    Imf::StdOSStream stream;
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(buffer);
      file.writePixels(height_px);
    }
    return stream.str();
  });
}

absl::StatusOr<Cryptomatte> read_cryptomatte(const std::filesystem::path& path) {
  const auto bad = [&path](std::string_view what) {
    return absl::DataLossError(fmt::format("{}: {}", path.string(), what));
  };
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    return absl::NotFoundError(fmt::format("there is no file {}", path.string()));
  try {
    Imf::InputFile file(path.c_str());
    const Imf::Header& header = file.header();
    const Imath::Box2i window = header.dataWindow();
    if (window != header.displayWindow() || window.min != Imath::V2i(0, 0))
      return bad("its data window is not the picture");
    Cryptomatte ids;
    ids.width_px = window.max.x + 1;
    ids.height_px = window.max.y + 1;
    std::string layer;
    for (auto attribute = header.begin(); attribute != header.end(); ++attribute) {
      const std::string name = attribute.name();
      const auto* const text = dynamic_cast<const Imf::StringAttribute*>(&attribute.attribute());
      if (text == nullptr || !name.starts_with("cryptomatte/")) continue;
      ids.attributes[name] = text->value();
      if (name.ends_with("/name")) layer = text->value();
    }
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      if (!layer.empty() && std::string_view(channel.name()).starts_with(layer) &&
          channel.channel().type == Imf::FLOAT)
        ids.channels.emplace_back(channel.name());
    }
    if (ids.channels.empty()) return bad("it is no Cryptomatte of 32 bits");
    Imf::FrameBuffer buffer;
    const size_t pixels = static_cast<size_t>(ids.width_px) * ids.height_px;
    ids.planes.resize(ids.channels.size(), std::vector<float>(pixels));
    for (size_t c = 0; c < ids.channels.size(); ++c)
      buffer.insert(ids.channels[c], Imf::Slice::Make(Imf::FLOAT, ids.planes[c].data(), window));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return ids;
  } catch (const std::exception& error) {
    return bad(error.what());
  }
}

}  // namespace glasswing
