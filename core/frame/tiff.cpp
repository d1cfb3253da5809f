// The format of frame files, laid out so that rows can be read in place: a fixed header of kTiffPixelOffset
// bytes, then the pixels (TIFF 6.0, baseline rgb or grayscale, 16 bit, one strip, little endian).
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>

#include "core/frame/archive.h"

namespace glasswing {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are copied in memory order");

struct Entry {
  std::uint16_t tag, type;
  std::uint32_t count, value;
};
static_assert(sizeof(Entry) == 12);
constexpr std::uint16_t kShort = 3, kLong = 4;
constexpr size_t kEntryCount = 11;
constexpr std::uint32_t kBitsOffset = 200;

constexpr const char* kNoHeader =
    "not a frame's header (16-bit TIFF of rgb or one channel, uncompressed, one strip at byte 256)";

std::string header_of(const FrameShape& shape) {
  const auto width = static_cast<std::uint32_t>(shape.width_px),
             height = static_cast<std::uint32_t>(shape.height_px),
             channels = static_cast<std::uint32_t>(shape.channels);
  const bool rgb = shape.channels == 3;
  const std::array<Entry, kEntryCount> entries{{{256, kLong, 1, width},
                                                {257, kLong, 1, height},
                                                {258, kShort, channels, rgb ? kBitsOffset : 16u},
                                                {259, kShort, 1, 1},              // no compression
                                                {262, kShort, 1, rgb ? 2u : 1u},  // rgb, or 0 is black
                                                {273, kLong, 1, kTiffPixelOffset},
                                                {274, kShort, 1, 1},  // top-left first
                                                {277, kShort, 1, channels},
                                                {278, kLong, 1, height},
                                                {279, kLong, 1, width * height * channels * 2},
                                                {284, kShort, 1, 1}}};
  std::string header(kTiffPixelOffset, '\0');
  const std::array<std::uint16_t, 2> magic{0x4949, 42};
  const std::uint32_t first_directory = 8;
  const auto count = static_cast<std::uint16_t>(entries.size());
  const std::array<std::uint16_t, 3> bits{16, 16, 16};
  std::memcpy(&header[0], magic.data(), 4);
  std::memcpy(&header[4], &first_directory, 4);
  std::memcpy(&header[8], &count, 2);
  std::memcpy(&header[10], entries.data(), sizeof entries);
  if (rgb) std::memcpy(&header[kBitsOffset], bits.data(), sizeof bits);
  return header;
}

// The shape that such a header gives. Its sides need not be sensible.
FrameShape shape_in(std::string_view header) {
  constexpr size_t kEntries = 10, kValue = 8, kWidth = 0, kHeight = 1, kChannels = 7;
  const auto value = [&](size_t entry) {
    std::int32_t number = 0;
    std::memcpy(&number, &header[kEntries + entry * sizeof(Entry) + kValue], sizeof number);
    return number;
  };
  return {.width_px = value(kWidth), .height_px = value(kHeight), .channels = value(kChannels)};
}

}  // namespace

std::string encode_tiff(const Image16& image) {
  std::string bytes = header_of(shape_of(image));
  bytes.append(reinterpret_cast<const char*>(image.samples.data()), image.samples.size() * 2);
  return bytes;
}

absl::StatusOr<Image16> decode_tiff(std::string_view bytes) {
  if (bytes.size() < kTiffPixelOffset) return absl::DataLossError("shorter than a frame's header");
  const FrameShape shape = shape_in(bytes);
  // Keeps the size within 32 bits.
  const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (!good(shape.width_px) || !good(shape.height_px) || (shape.channels != 1 && shape.channels != 3) ||
      bytes.substr(0, kTiffPixelOffset) != header_of(shape)) {
    return absl::DataLossError(kNoHeader);
  }
  // Checked before allocating, since the header may promise more than the file holds.
  const size_t size = tiff_size_bytes(shape);
  if (bytes.size() != size) {
    return absl::DataLossError(
        fmt::format("holds {} bytes; {}x{} needs {}", bytes.size(), shape.width_px, shape.height_px, size));
  }
  Image16 image(shape.width_px, shape.height_px, shape.channels);
  std::memcpy(image.samples.data(), &bytes[kTiffPixelOffset], image.samples.size() * 2);
  return image;
}

absl::Status check_tiff_header(std::string_view bytes, const FrameShape& shape) {
  if (bytes.substr(0, kTiffPixelOffset) == header_of(shape)) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{} of {}x{} px with {} channel{}", kNoHeader, shape.width_px,
                                         shape.height_px, shape.channels, shape.channels == 1 ? "" : "s"));
}

}  // namespace glasswing
