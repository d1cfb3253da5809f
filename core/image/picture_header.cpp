#include "core/image/picture_header.h"

#include <fmt/format.h>
#include <zlib.h>

#include <charconv>
#include <climits>
#include <cstdlib>
#include <optional>

#include "core/base/number_at.h"
#include "core/base/status.h"
#include "core/image/image.h"
#include "core/image/tiff_directory.h"

namespace glasswing {
namespace {

bool has(std::string_view bytes, std::string_view text, size_t at = 0) {
  return bytes.size() >= at && bytes.substr(at).starts_with(text);
}

// 0 if the file ends before it.
std::uint64_t little(std::string_view bytes, size_t at, size_t size) {
  return number_at(bytes, at, size, std::endian::little).value_or(0);
}
std::uint64_t big(std::string_view bytes, size_t at, size_t size) {
  return number_at(bytes, at, size, std::endian::big).value_or(0);
}

PictureSize size_of(std::uint64_t width_px, std::uint64_t height_px) {
  const auto side = [](std::uint64_t px) { return static_cast<int>(std::min<std::uint64_t>(px, INT_MAX)); };
  return {.width_px = side(width_px), .height_px = side(height_px)};
}

bool is_webp(std::string_view bytes) {
  return has(bytes, "RIFF") && has(bytes, "WEBP", 8);
}

absl::Status cut_off(std::uint64_t needed, size_t has) {
  return absl::DataLossError(fmt::format("it is truncated: it has {} bytes of {}", has, needed));
}

absl::Status other_kind(std::string_view bytes) {
  const std::string_view kind = has(bytes, "GIF8")               ? "a GIF"
                                : has(bytes, "ftyp", 4)          ? "a HEIC, an AVIF or a video"
                                : has(bytes, "\x76\x2f\x31\x01") ? "an OpenEXR"
                                                                 : "a file of another kind";
  return absl::DataLossError(
      fmt::format("it is {}, not a PNG, JPEG, TIFF, WebP, BMP, PGM or PPM; convert it to PNG", kind));
}

// libpng only warns about damage, so every chunk's CRC is checked here, up to and including IEND.
absl::Status check_png(std::string_view bytes) {
  size_t at = 8;
  while (bytes.size() >= at + 12) {
    const size_t length = big(bytes, at, 4);
    if (length > bytes.size() - at - 12) break;
    const auto* chunk = reinterpret_cast<const Bytef*>(&bytes[at + 4]);
    if (crc32(0, chunk, static_cast<uInt>(length + 4)) != big(bytes, at + 8 + length, 4))
      return absl::DataLossError("a PNG chunk's CRC is wrong");
    if (has(bytes, "IEND", at + 4)) return absl::OkStatus();
    at += length + 12;
  }
  return absl::DataLossError("the PNG is truncated");
}

// A JPEG's markers (ITU-T T.81, annex B).
struct JpegHeader {
  PictureSize size;  // 0x0 if no frame header precedes the data
  size_t scan = 0;   // where the entropy-coded data begins; 0: not found
};

JpegHeader jpeg_header(std::string_view bytes) {
  constexpr std::uint64_t kMarker = 0xFF, kStartOfScan = 0xDA;
  // SOF0 to SOF15, except DHT, JPG and DAC, which share their range.
  const auto is_frame = [](std::uint64_t marker) {
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
  };
  JpegHeader header;
  for (size_t at = 2; at + 9 <= bytes.size() && big(bytes, at, 1) == kMarker;) {
    const std::uint64_t marker = big(bytes, at + 1, 1);
    if (marker == kMarker) {  // fill
      ++at;
      continue;
    }
    if (is_frame(marker)) header.size = size_of(big(bytes, at + 7, 2), big(bytes, at + 5, 2));
    if (marker == kStartOfScan) {
      header.scan = at;
      break;
    }
    at += 2 + big(bytes, at + 2, 2);
  }
  return header;
}

// libjpeg fills a truncated picture with grey.
absl::Status check_jpeg(std::string_view bytes) {
  const size_t scan = jpeg_header(bytes).scan;
  if (scan == 0) return absl::DataLossError("the JPEG's headers are damaged, or truncated");
  // Entropy-coded data never contains a marker.
  if (bytes.find("\xFF\xD9", scan) == std::string_view::npos)
    return absl::DataLossError("the JPEG is truncated");
  return absl::OkStatus();
}

// Kinds that OpenCV 4.6 reads correctly.
absl::Status check_tiff(const TiffDirectory& tiff) {
  const auto number = [&](TiffDirectory::Tag tag, std::uint64_t otherwise) {
    return tiff.number(tag).value_or(otherwise);
  };
  const auto bad = [](const std::string& what, const char* cure) {
    return absl::DataLossError(fmt::format("it is a TIFF {}; write it {}", what, cure));
  };
  constexpr std::uint64_t kUnsigned = 1, kFloat = 3, kColour = 2, kPalette = 3, kYCbCr = 6;
  const std::uint64_t bits = number(TiffDirectory::kBits, 1), samples = number(TiffDirectory::kSamples, 1),
                      format = number(TiffDirectory::kFormat, kUnsigned),
                      colours = number(TiffDirectory::kPhotometric, kColour);
  const bool floats = format == kFloat && bits == 32;
  if (!floats && (format != kUnsigned || bits > 16))
    return bad(fmt::format("with samples of {} bits that are {}", bits,
                           format == kFloat      ? "floating-point numbers"
                           : format == kUnsigned ? "whole numbers"
                                                 : "signed or complex"),
               "with 8 or 16 bits, or as 32-bit float");
  if (colours > kColour && (bits != 8 || (colours != kPalette && colours != kYCbCr)))
    return bad("with colours other than gray and RGB", "as RGB");
  if (floats && colours == 0) return bad("with floats whose 0 is white", "with 0 as black");
  if (samples > 1 && bits != 8 && number(TiffDirectory::kPlanar, 1) == 2)
    return bad("with one plane per colour", "interleaved");
  if (samples == 2 && (bits != 8 || tiff.number(TiffDirectory::kTileWidth)))
    return bad("of gray with alpha", "without alpha");
  return absl::OkStatus();
}

absl::StatusOr<PictureSize> bmp_size(std::string_view bytes) {
  constexpr size_t kHeader = 54;  // BITMAPFILEHEADER and BITMAPINFOHEADER
  if (bytes.size() < kHeader) return cut_off(kHeader, bytes.size());
  const auto width = static_cast<std::int32_t>(little(bytes, 18, 4)),
             height = static_cast<std::int32_t>(little(bytes, 22, 4));  // below 0: the top row first
  const std::uint64_t bits = little(bytes, 28, 2);
  if (little(bytes, 14, 4) < 40 || little(bytes, 30, 4) != 0 || (bits != 8 && bits != 24 && bits != 32))
    return absl::DataLossError(
        "it is a BMP of an old or compressed kind; 8, 24 or 32 bits per pixel are "
        "supported");
  const auto columns = static_cast<std::uint64_t>(std::max(width, 0)),
             rows = static_cast<std::uint64_t>(std::abs(std::int64_t{height}));
  const std::uint64_t needed = little(bytes, 10, 4) + (columns * bits + 31) / 32 * 4 * rows;
  if (bytes.size() < needed) return cut_off(needed, bytes.size());
  return size_of(columns, rows);
}

// A number of a PGM's header, after white space and comments.
std::optional<std::uint64_t> pnm_number(std::string_view bytes, size_t& at) {
  while (at < bytes.size() &&
         (std::isspace(static_cast<unsigned char>(bytes[at])) != 0 || bytes[at] == '#')) {
    if (bytes[at] == '#') at = std::min(bytes.find('\n', at), bytes.size() - 1);
    ++at;
  }
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(bytes.data() + at, bytes.data() + bytes.size(), value);
  if (error != std::errc()) return std::nullopt;
  at = static_cast<size_t>(end - bytes.data());
  return value;
}

absl::StatusOr<PictureSize> pnm_size(std::string_view bytes) {
  size_t at = 2;
  const auto width = pnm_number(bytes, at), height = pnm_number(bytes, at), highest = pnm_number(bytes, at);
  if (!width || !height || !highest || *width > INT_MAX || *height > INT_MAX)
    return absl::DataLossError("its header is damaged");
  if (*highest != 255 && *highest != 65535)
    return absl::DataLossError(fmt::format("its highest code is {}; it must be 255 or 65535", *highest));
  const std::uint64_t pixel = (bytes[1] == '6' ? 3 : 1) * (*highest > 255 ? 2 : 1);
  const std::uint64_t needed = at + 1 + *width * *height * pixel;
  if (*width * *height > (std::uint64_t{1} << 40) || bytes.size() < needed)
    return cut_off(needed, bytes.size());
  return size_of(*width, *height);
}

// By its first chunk: lossy, lossless, or a list of what follows (RFC 9649).
PictureSize webp_size(std::string_view bytes) {
  constexpr size_t kChunk = 12;
  constexpr std::uint64_t kSide = 0x3FFF;
  if (has(bytes, "VP8 ", kChunk)) return size_of(little(bytes, 26, 2) & kSide, little(bytes, 28, 2) & kSide);
  if (has(bytes, "VP8X", kChunk)) return size_of(little(bytes, 24, 3) + 1, little(bytes, 27, 3) + 1);
  const std::uint64_t sides = little(bytes, 21, 4);
  return has(bytes, "VP8L", kChunk) ? size_of((sides & kSide) + 1, (sides >> 14 & kSide) + 1) : PictureSize();
}

absl::Status check_webp(std::string_view bytes) {
  constexpr std::uint64_t kRiff = 8;  // bytes before those that it counts
  if (const std::uint64_t needed = little(bytes, 4, 4) + kRiff; bytes.size() < needed)
    return cut_off(needed, bytes.size());
  constexpr std::uint64_t kAnimated = 2;
  if (has(bytes, "VP8X", 12) && (little(bytes, 20, 1) & kAnimated) != 0)
    return absl::DataLossError("it is an animated WebP; convert it to PNG");
  return absl::OkStatus();
}

absl::StatusOr<PictureSize> size_in(std::string_view bytes) {
  if (is_png(bytes))
    return has(bytes, "IHDR", 12) ? size_of(big(bytes, 16, 4), big(bytes, 20, 4)) : PictureSize();
  if (is_jpeg(bytes)) return jpeg_header(bytes).size;
  if (is_webp(bytes)) return webp_size(bytes);
  if (has(bytes, "BM")) return bmp_size(bytes);
  if (has(bytes, "P5") || has(bytes, "P6")) return pnm_size(bytes);
  if (!is_tiff(bytes)) return other_kind(bytes);
  const TiffDirectory tiff(bytes);
  return size_of(tiff.number(TiffDirectory::kWidth).value_or(0),
                 tiff.number(TiffDirectory::kHeight).value_or(0));
}

}  // namespace

bool is_png(std::string_view bytes) {
  return has(bytes, "\x89PNG\r\n\x1a\n");
}

bool is_jpeg(std::string_view bytes) {
  return has(bytes, "\xFF\xD8\xFF");
}

absl::StatusOr<PictureSize> picture_size(std::string_view bytes) {
  if (bytes.empty()) return absl::DataLossError("it is empty");
  GW_ASSIGN_OR_RETURN(const PictureSize size, size_in(bytes));
  const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (good(size.width_px) && good(size.height_px)) return size;
  return absl::DataLossError(fmt::format("its header says {}x{}; each side must be 1 to {} px", size.width_px,
                                         size.height_px, kMaxSide_px));
}

absl::Status check_picture(std::string_view bytes) {
  if (is_png(bytes)) return check_png(bytes);
  if (is_jpeg(bytes)) return check_jpeg(bytes);
  if (is_webp(bytes)) return check_webp(bytes);
  return is_tiff(bytes) ? check_tiff(TiffDirectory(bytes)) : absl::OkStatus();
}

std::string_view exif_of(std::string_view bytes) {
  constexpr std::string_view kInJpeg("Exif\0\0", 6), kInWebp("EXIF");
  constexpr size_t kChunkHead = 8;
  const bool jpeg = is_jpeg(bytes);
  const size_t exif = jpeg             ? bytes.substr(0, jpeg_header(bytes).scan).find(kInJpeg)
                      : is_webp(bytes) ? bytes.find(kInWebp)
                                       : std::string_view::npos;
  if (exif == std::string_view::npos) return "";
  return bytes.substr(std::min(exif + (jpeg ? kInJpeg.size() : kChunkHead), bytes.size()));
}

}  // namespace glasswing
