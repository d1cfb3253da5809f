// Reading and writing picture files. Every error names the path; OpenCV stays inside. UNIMPLEMENTED, of all
// functions that decode or encode other pictures than EXR and .hdr: this installation lacks the codecs
// (picture_codecs.h).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/frame/image.h"
#include "core/frame/mosaic.h"
#include "core/frame/picture_header.h"

namespace glasswing {

enum class Encoding {
  kDisplay,  // sRGB, except EXR and .hdr, which are linear
  kLinear,   // every format holds linear radiance, value / full scale
};

// Reads the pictures of picture_size(), Radiance's .hdr, and EXR, upright; gray becomes r = g = b, alpha is
// dropped. DATA_LOSS names a file that is damaged, not a picture, or of a kind that is not read; NOT_FOUND a
// missing one.
absl::StatusOr<RadianceImage> read_radiance(const std::filesystem::path& path, Encoding encoding);

// The same from a file's bytes, EXR excepted. DATA_LOSS: damaged, or not a picture.
absl::StatusOr<RadianceImage> decode_radiance(std::string_view bytes, Encoding encoding);

// sRGB code to linear light and back (IEC 61966-2-1), both 0 to 1; srgb_of_linear clamps its argument.
float linear_of_srgb(float code);
float srgb_of_linear(float light);
// Linear light of each code of 8 bits.
const std::array<float, 256>& light_of_srgb_codes();

// What is known of the R, G and B of a picture, as EXR files say it in their headers.
struct PictureColour {
  std::string interop_id = "unknown";  // colorInteropID: a name of the Color Interop Forum
  std::string space;                   // oiio:ColorSpace; empty: not told
  // x and y of red, green, blue and white; absent: not told.
  std::optional<std::array<float, 8>> chromaticities;
  bool operator==(const PictureColour&) const = default;
};
// Linear light of the primaries of ITU-R BT.709, which are sRGB's.
const PictureColour& linear_rec709();
// Of the light that read_radiance() gives: linear Rec. 709 of a file of sRGB codes, of an EXR what its header
// says, and else, or where the file cannot be read, unknown.
PictureColour colour_of_file(const std::filesystem::path& path, Encoding encoding);

// Which of an EXR's layers read_radiance() takes, where it is not the plain one (open_exr.h); else empty.
std::string layer_of_file(const std::filesystem::path& path);

// Linear radiance to .exr (ZIP; 16 or 32 bit floats), .png or .tif/.tiff (8 or 16 bit), by the path's suffix.
// `bits` 0: 32 for EXR, 8 for sRGB, 16 for linear codes. An EXR's header says `colour`. The file is written
// atomically. INVALID_ARGUMENT names the path: another suffix, or bits that the format does not support.
// An EXR has A, which is 1; with `coverage`, of one channel, A is that, and R, G and B are premultiplied. A
// PNG with it has alpha, and its colours are not premultiplied, as PNG has them. INVALID_ARGUMENT: a TIFF
// with it.
absl::StatusOr<std::string> encode_radiance(const std::filesystem::path& name, const RadianceImage& image,
                                            Encoding encoding, int bits = 0, const PictureColour& colour = {},
                                            const RadianceImage* coverage = nullptr);
absl::Status write_radiance(const std::filesystem::path& path, const RadianceImage& image, Encoding encoding,
                            int bits = 0, const PictureColour& colour = {});
// Returns that error before a picture is computed.
absl::Status check_picture_file(const std::filesystem::path& path, int bits, bool with_coverage = false);

// Writes sRGB codes, r, g, b by rows, to a PNG. Not flushed to disk. UNAVAILABLE: it cannot be written.
absl::Status write_srgb8(const std::filesystem::path& path, std::span<const std::uint8_t> codes, int width_px,
                         int height_px);

// Reads a linear frame: 16-bit PNG or TIFF, or 8-bit (JPEG too), scaled by 257. DATA_LOSS names a file that
// is truncated, altered (a PNG's CRC is checked), not a picture, or not of size `expected`, which is checked
// before decoding.
absl::StatusOr<Image16> read_frame_file(const std::filesystem::path& path,
                                        std::optional<PictureSize> expected = std::nullopt);
// The same of a camera's frame: as it is stored where the camera has a mosaic. DATA_LOSS, too, if that file
// has more than one channel.
absl::StatusOr<Image16> read_frame_file(const std::filesystem::path& path, const FrameShape& expected);

// When a JPEG or TIFF was taken, as EXIF says it: "2016:12:09 15:04:09.12"; empty: it does not.
std::string date_taken(std::string_view bytes);

// A photograph in its own codes; gray becomes r = g = b, and alpha is dropped. Its pixels
// lie as the sensor has them, however EXIF says that the camera was held: a camera that looks down wavers.
// DATA_LOSS names a file that is missing, truncated, of float samples, or of another format.
struct CodedPhotograph {
  Image16 codes;        // 65535 = white; of one channel where there is a mosaic
  int bits = 0;         // per code: the file's 8 or 16, or those of `white`
  bool turned = false;  // EXIF says that the camera was not held upright
  bool raw = false;     // codes are linear (raw_photograph.h)
  // Of a raw file, as v1::Camera has them.
  std::string mosaic = {};
  double black_level = 0.0;
  // As the camera notes them.
  std::optional<double> exposure_ms = {}, iso = {};
};
// `white`: the highest code that the camera writes, where the file's own could be higher: 1023 of 10 bits in
// 16. INVALID_ARGUMENT: it is not 1 to the file's highest code, or the photograph has higher ones. A raw file
// knows its own; higher codes are saturated.
absl::StatusOr<CodedPhotograph> read_photograph(const std::filesystem::path& path,
                                                std::optional<int> white = std::nullopt);
// The same of a file's bytes; errors name `path`, whose suffix tells a raw file.
absl::StatusOr<CodedPhotograph> decode_photograph(const std::filesystem::path& path, std::string_view bytes,
                                                  std::optional<int> white = std::nullopt);
// Raises or lowers a raw file's codes so that this is black: cameras measure it anew with each exposure.
void set_black(double black_level, CodedPhotograph& photograph);
// For looking at: with all colours at each pixel.
Image16 interpolated(const CodedPhotograph& photograph);
// The exposure time that the camera notes in the file, of which a raw one is read by its header alone. None:
// it notes none, or the file cannot be read.
std::optional<double> exposure_noted_in(const std::filesystem::path& path);
// The highest code of a file of so many bits.
inline int highest_code(int bits) {
  return (1 << bits) - 1;
}

// Linear 16-bit PNG, the format in which pictures are sent to displays; decode_png also accepts 8 bit.
// INVALID_ARGUMENT: not a PNG, damaged, or a side is not 1 to 16384 px.
absl::StatusOr<std::string> encode_png16(const Image16& image);
absl::StatusOr<Image16> decode_png(std::string_view bytes);

// JPEG, 8 bit sRGB.
absl::StatusOr<std::string> encode_jpeg(const RadianceImage& image);

// Resamples to exactly this size, each axis by area (down) or bilinearly (up).
RadianceImage resized(const RadianceImage& image, int width_px, int height_px);

}  // namespace glasswing
