// Picture files. What cannot be read or written is one error with the path; OpenCV stays inside.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/frame/image.h"

namespace glasswing {

enum class Encoding {
  kDisplay,  // PNG, JPEG and TIFF hold sRGB; EXR is linear
  kLinear,   // every format holds linear radiance, value / full scale
};

// Any 8-, 16-bit or float picture OpenCV reads, EXR too; gray becomes r = g = b, alpha is dropped.
// DATA_LOSS names a file that is damaged or no picture; NOT_FOUND one that is missing.
absl::StatusOr<RadianceImage> read_radiance(const std::filesystem::path& path, Encoding encoding);

// The same of a file's bytes; not of an EXR. DATA_LOSS: it is damaged or no picture.
absl::StatusOr<RadianceImage> decode_radiance(std::string_view bytes, Encoding encoding);

// The light of an sRGB code (IEC 61966-2-1), both 0 to 1, and the code of a light, which is clamped.
float linear_of_srgb(float code);
float srgb_of_linear(float light);

// Linear radiance to .exr (ZIP; 16 or 32 bit floats), .png or .tif/.tiff (8 or 16 bit), by the path's suffix.
// `bits` 0: 32 of an EXR, 8 of sRGB, 16 of linear codes. The file is whole or not there. INVALID_ARGUMENT:
// another suffix, or bits that it cannot have.
absl::Status write_radiance(const std::filesystem::path& path, const RadianceImage& image, Encoding encoding,
                            int bits = 0);
// That error, before there is a picture.
absl::Status check_picture_file(const std::filesystem::path& path, int bits);

// sRGB codes, r, g, b by rows, to a PNG. It need not outlive a power cut. UNAVAILABLE: it cannot be written.
absl::Status write_srgb8(const std::filesystem::path& path, std::span<const std::uint8_t> codes, int width_px,
                         int height_px);

struct PictureSize {
  int width_px = 0, height_px = 0;
  bool operator==(const PictureSize&) const = default;
};
// What the header of a PNG, JPEG or TIFF says; nothing is decoded. DATA_LOSS: it is none of them, damaged, or
// a side is not 1 to 16384 px.
absl::StatusOr<PictureSize> picture_size(std::string_view bytes);

// 16-bit linear frames, PNG or TIFF; 8-bit ones, JPEG too, are scaled by 257. DATA_LOSS names the file:
// truncated, altered (a PNG's CRC is checked), not a picture, or of another size than `expected`, which is
// found out before a pixel is decoded.
absl::StatusOr<Image16> read_frame_file(const std::filesystem::path& path,
                                        std::optional<PictureSize> expected = std::nullopt);

// A photograph in its own codes. PNG, JPEG or TIFF; gray becomes r = g = b, alpha is dropped, and a JPEG is
// turned as its EXIF says. DATA_LOSS names a file that is missing, truncated, of float samples, or none of
// these.
struct CodedPhotograph {
  Image16 codes;  // 65535 = the highest code
  int bits = 0;   // of a code in the file: 8 or 16
};
absl::StatusOr<CodedPhotograph> read_photograph(const std::filesystem::path& path);

// PNG, 16 bit, linear: how pictures travel to displays. `bytes` for decode may also be 8 bit.
// INVALID_ARGUMENT: it is none, or a side is not 1 to 16384 px.
std::string encode_png16(const Image16& image);
absl::StatusOr<Image16> decode_png(std::string_view bytes);

// JPEG, 8 bit sRGB.
std::string encode_jpeg(const RadianceImage& image);

// Resampled to exactly this size, each axis by area (down) or bilinearly (up).
RadianceImage resized(const RadianceImage& image, int width_px, int height_px);

}  // namespace glasswing
