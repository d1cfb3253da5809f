#include "core/image/open_exr.h"

#include <ImathBox.h>
#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfRgbaFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <absl/strings/ascii.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/status.h"
#include "core/file/mapped_file.h"
#include "core/image/exr_limits.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr size_t kRgb = 3;

PictureColour colour_in(const Imf::Header& header) {
  PictureColour colour;
  if (const auto* id = header.findTypedAttribute<Imf::StringAttribute>(kInteropId))
    colour.interop_id = id->value();
  if (const auto* space = header.findTypedAttribute<Imf::StringAttribute>(kOiioSpace))
    colour.space = space->value();
  if (Imf::hasChromaticities(header)) {
    const auto& [red, green, blue, white] = Imf::chromaticities(header);
    colour.chromaticities = {red.x, red.y, green.x, green.y, blue.x, blue.y, white.x, white.y};
    // If a file has only these, its samples are linear, as OpenEXR defines.
    if (colour.chromaticities == linear_rec709().chromaticities && colour.interop_id == "unknown" &&
        colour.space.empty())
      return linear_rec709();
  }
  return colour;
}

// The channels of a part that are its picture.
struct Layer {
  int part = 0;
  std::array<std::string, kRgb> channels;
  bool gray = false;  // the first channel stands for all
  bool luma = false;  // luminance and chroma, which only the library's own reader joins
};

// "View Layer.Combined." of "View Layer.Combined.R"; empty: no layer.
std::string prefix_of(std::string_view channel) {
  const size_t dot = channel.rfind('.');
  return dot == std::string_view::npos ? "" : std::string(channel.substr(0, dot + 1));
}

bool is_whole_picture(std::string prefix) {
  constexpr std::array<std::string_view, 4> kNames{"combined", "beauty", "rgba", "composite"};
  if (!prefix.empty()) prefix.pop_back();
  const std::string name = absl::AsciiStrToLower(prefix.substr(prefix.rfind('.') + 1));
  return std::ranges::find(kNames, name) != kNames.end();
}

// The layer of one part; none: it has no colours. INVALID_ARGUMENT: several have.
absl::StatusOr<std::optional<Layer>> layer_of(const Imf::Header& header, int part) {
  const Imf::ChannelList& channels = header.channels();
  const auto has = [&](const std::string& name) { return channels.findChannel(name) != nullptr; };
  if (has("Y")) {
    const bool chroma = has("RY") && has("BY");
    if (!chroma || part == 0)
      return Layer{.part = part, .channels = {"Y", "", ""}, .gray = !chroma, .luma = chroma};
  }
  if (has("R") || has("G") || has("B")) return Layer{.part = part, .channels = {"R", "G", "B"}};
  std::set<std::string> prefixes;
  for (auto channel = channels.begin(); channel != channels.end(); ++channel) {
    const std::string prefix = prefix_of(channel.name());
    if (!prefix.empty() && has(prefix + "R") && has(prefix + "G") && has(prefix + "B"))
      prefixes.insert(prefix);
  }
  if (prefixes.size() > 1) {
    std::vector<std::string> whole;
    std::ranges::copy_if(prefixes, std::back_inserter(whole), is_whole_picture);
    if (whole.size() != 1) {
      return absl::InvalidArgumentError(
          fmt::format("several of its layers have colours: {}; write only one of them, as R, G and B",
                      fmt::join(prefixes, ", ")));
    }
    prefixes = {whole.front()};
  }
  if (prefixes.empty()) return std::optional<Layer>();
  const std::string& prefix = *prefixes.begin();
  return Layer{.part = part, .channels = {prefix + "R", prefix + "G", prefix + "B"}};
}

absl::StatusOr<Layer> layer_in(const Imf::MultiPartInputFile& file) {
  std::vector<std::string> names;  // of the first channels
  constexpr size_t kMaxNames = 16;
  for (int part = 0; part < file.parts(); ++part) {
    const Imf::Header& header = file.header(part);
    if (header.hasType() && Imf::isDeepData(header.type())) continue;
    GW_ASSIGN_OR_RETURN(const std::optional<Layer> layer, layer_of(header, part));
    if (layer) return *layer;
    for (auto channel = header.channels().begin();
         channel != header.channels().end() && names.size() <= kMaxNames; ++channel)
      names.emplace_back(names.size() < kMaxNames ? channel.name() : "...");
  }
  return absl::InvalidArgumentError(
      fmt::format("none of its layers has colours; its channels are {}", fmt::join(names, ", ")));
}

// The data window's pixels.
RadianceImage read_channels(Imf::MultiPartInputFile& file, const Layer& layer, const Imath::Box2i& window) {
  RadianceImage image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1);
  Imf::InputPart part(file, layer.part);
  constexpr size_t kPixel = kRgb * sizeof(float);
  Imf::FrameBuffer frame;
  for (size_t c = 0; c < kRgb; ++c) {
    if (layer.channels[c].empty()) continue;
    frame.insert(layer.channels[c], Imf::Slice::Make(Imf::FLOAT, image.samples.data() + c, window, kPixel,
                                                     kPixel * static_cast<size_t>(image.width_px)));
  }
  part.setFrameBuffer(frame);
  part.readPixels(window.min.y, window.max.y);
  for (size_t i = 0; layer.gray && i < image.samples.size(); i += kRgb)
    image.samples[i + 1] = image.samples[i + 2] = image.samples[i];
  return image;
}

// Luminance and chroma, as halves.
RadianceImage read_luma(const fs::path& path, const Imath::Box2i& window) {
  RadianceImage image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1);
  Imf::RgbaInputFile file(path.c_str());
  Imf::Array2D<Imf::Rgba> pixels(image.height_px, image.width_px);
  file.setFrameBuffer(
      &pixels[0][0] - window.min.x - static_cast<std::ptrdiff_t>(window.min.y) * image.width_px, 1,
      static_cast<size_t>(image.width_px));
  file.readPixels(window.min.y, window.max.y);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const Imf::Rgba& pixel = pixels[y][x];
      image.at(x, y, 0) = pixel.r, image.at(x, y, 1) = pixel.g, image.at(x, y, 2) = pixel.b;
    }
  }
  return image;
}

// The part of `data`, placed in its window, that is in the display window; black elsewhere.
RadianceImage placed(const RadianceImage& data, const Imath::Box2i& window, const Imath::Box2i& display) {
  if (window == display) return data;
  RadianceImage image(display.max.x - display.min.x + 1, display.max.y - display.min.y + 1);
  const int left = std::max(window.min.x, display.min.x), right = std::min(window.max.x, display.max.x);
  for (int y = std::max(window.min.y, display.min.y); y <= std::min(window.max.y, display.max.y); ++y) {
    for (int x = left; x <= right; ++x) {
      for (int c = 0; c < static_cast<int>(kRgb); ++c) {
        image.at(x - display.min.x, y - display.min.y, c) = data.at(x - window.min.x, y - window.min.y, c);
      }
    }
  }
  return image;
}

absl::Status check_size(const Imath::Box2i& window, const char* name) {
  const auto side = [](int low, int high) { return std::int64_t{high} - low + 1; };
  const std::int64_t width = side(window.min.x, window.max.x), height = side(window.min.y, window.max.y);
  if (width >= 1 && height >= 1 && width <= kMaxExr_px && height <= kMaxExr_px / width)
    return absl::OkStatus();
  return absl::DataLossError(
      fmt::format("its {} is of {}x{} px; at most {} px are supported", name, width, height, kMaxExr_px));
}

absl::Status check_finite(const RadianceImage& image) {
  const auto is_bad = [](float sample) { return !std::isfinite(sample); };
  const auto bad = std::ranges::count_if(image.samples, is_bad);
  if (bad == 0) return absl::OkStatus();
  const auto first =
      static_cast<size_t>(std::ranges::find_if(image.samples, is_bad) - image.samples.begin()) / kRgb;
  const size_t width = image.width_px;
  return absl::DataLossError(fmt::format("{} of its values {} not finite, the first at x {}, y {}", bad,
                                         bad == 1 ? "is" : "are", first % width, first / width));
}

absl::Status check_limits(const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, MappedFile::open(path));
  return check_exr_limits(file->bytes());
}

absl::StatusOr<RadianceImage> read(const fs::path& path) {
  GW_RETURN_IF_ERROR(check_limits(path));
  Imf::MultiPartInputFile file(path.c_str());
  GW_ASSIGN_OR_RETURN(const Layer layer, layer_in(file));
  const Imath::Box2i window = file.header(layer.part).dataWindow(),
                     display = file.header(layer.part).displayWindow();
  GW_RETURN_IF_ERROR(check_size(window, "data window"));
  GW_RETURN_IF_ERROR(check_size(display, "display window"));
  RadianceImage image =
      placed(layer.luma ? read_luma(path, window) : read_channels(file, layer, window), window, display);
  GW_RETURN_IF_ERROR(check_finite(image));
  return image;
}

}  // namespace

absl::StatusOr<RadianceImage> read_open_exr(const fs::path& path) {
  try {
    absl::StatusOr<RadianceImage> image = read(path);
    if (image.ok()) return image;
    return absl::Status(image.status().code(),
                        fmt::format("{}: {}", path.string(), std::string(image.status().message())));
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("{}: {}", path.string(), error.what()));
  }
}

std::string layer_of_open_exr(const fs::path& path) {
  try {
    const Imf::MultiPartInputFile file(path.c_str());
    const absl::StatusOr<Layer> layer = layer_in(file);
    if (!layer.ok()) return "";
    std::vector<std::string> words;
    if (layer->part > 0) {
      const Imf::Header& header = file.header(layer->part);
      words.push_back(
          fmt::format("part {}{}", layer->part + 1, header.hasName() ? ", " + header.name() : ""));
    }
    const std::string prefix = prefix_of(layer->channels[0]);
    if (!prefix.empty()) words.push_back("layer " + prefix.substr(0, prefix.size() - 1));
    return fmt::format("{}", fmt::join(words, ", "));
  } catch (const std::exception&) {
    return "";
  }
}

PictureColour colour_of_open_exr(const fs::path& path) {
  if (!check_limits(path).ok()) return {};
  try {
    const Imf::MultiPartInputFile file(path.c_str());
    const absl::StatusOr<Layer> layer = layer_in(file);
    return colour_in(file.header(layer.ok() ? layer->part : 0));
  } catch (const std::exception&) {
    return {};
  }
}

}  // namespace glasswing
