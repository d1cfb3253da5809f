// The format of frame files, laid out so that rows can be read in place: a fixed header of kTiffPixelOffset
// bytes, then the pixels (TIFF 6.0, baseline rgb, 16 bit, one strip, little endian).
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
    "not a frame's header (16-bit rgb TIFF, uncompressed, one strip at byte 256)";

std::string header_of(std::uint32_t width, std::uint32_t height) {
  const std::array<Entry, kEntryCount> entries{{{256, kLong, 1, width},
                                                {257, kLong, 1, height},
                                                {258, kShort, 3, kBitsOffset},
                                                {259, kShort, 1, 1},  // no compression
                                                {262, kShort, 1, 2},  // rgb
                                                {273, kLong, 1, kTiffPixelOffset},
                                                {274, kShort, 1, 1},  // top-left first
                                                {277, kShort, 1, 3},
                                                {278, kLong, 1, height},
                                                {279, kLong, 1, width * height * 6},
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
  std::memcpy(&header[kBitsOffset], bits.data(), sizeof bits);
  return header;
}

}  // namespace

std::string encode_tiff(const Image16& image) {
  std::string bytes =
      header_of(static_cast<std::uint32_t>(image.width_px), static_cast<std::uint32_t>(image.height_px));
  bytes.append(reinterpret_cast<const char*>(image.samples.data()), image.samples.size() * 2);
  return bytes;
}

absl::StatusOr<Image16> decode_tiff(std::string_view bytes) {
  constexpr size_t kWidthAt = 10 + 8, kHeightAt = 10 + 12 + 8;
  if (bytes.size() < kTiffPixelOffset) return absl::DataLossError("shorter than a frame's header");
  std::uint32_t width = 0, height = 0;
  std::memcpy(&width, &bytes[kWidthAt], 4);
  std::memcpy(&height, &bytes[kHeightAt], 4);
  constexpr std::uint32_t kMaxSide = kMaxSide_px;  // keeps width * height * 6 within 32 bits
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide ||
      bytes.substr(0, kTiffPixelOffset) != header_of(width, height)) {
    return absl::DataLossError(kNoHeader);
  }
  // Checked before allocating, since the header may promise more than the file holds.
  const size_t size = tiff_size_bytes(static_cast<int>(width), static_cast<int>(height));
  if (bytes.size() != size) {
    return absl::DataLossError(
        fmt::format("holds {} bytes; {}x{} needs {}", bytes.size(), width, height, size));
  }
  Image16 image(static_cast<int>(width), static_cast<int>(height));
  std::memcpy(image.samples.data(), &bytes[kTiffPixelOffset], image.samples.size() * 2);
  return image;
}

absl::Status check_tiff_header(std::string_view bytes, int width_px, int height_px) {
  const std::string header =
      header_of(static_cast<std::uint32_t>(width_px), static_cast<std::uint32_t>(height_px));
  if (bytes.substr(0, kTiffPixelOffset) == header) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{} of {}x{} px", kNoHeader, width_px, height_px));
}

}  // namespace glasswing
