// Reading and writing picture files. Every error names the path; OpenCV stays inside. UNIMPLEMENTED, from all
// functions that decode or encode pictures other than EXR and .hdr: this installation lacks the codecs
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

#include "core/image/image.h"
#include "core/image/mosaic.h"
#include "core/image/picture_header.h"

namespace glasswing {

enum class Encoding {
  kDisplay,  // sRGB, except EXR and .hdr, which are linear
  kLinear,   // every format holds linear radiance, value / full scale
};

// Reads the pictures of picture_size(), Radiance's .hdr, and EXR, upright; gray becomes r = g = b, alpha is
// dropped. DATA_LOSS names a file that is damaged, not a picture, or of an unsupported kind; NOT_FOUND a
// missing one.
absl::StatusOr<RadianceImage> read_radiance(const std::filesystem::path& path, Encoding encoding);

// The same from a file's bytes, except EXR. DATA_LOSS: damaged, or not a picture.
absl::StatusOr<RadianceImage> decode_radiance(std::string_view bytes, Encoding encoding);

// sRGB code to linear light and back (IEC 61966-2-1), both 0 to 1; srgb_of_linear clamps its argument.
float linear_of_srgb(float code);
float srgb_of_linear(float light);
// Linear light of each code of 8 bits.
const std::array<float, 256>& light_of_srgb_codes();

// What is known about the R, G and B of a picture, as recorded in EXR headers.
struct PictureColour {
  std::string interop_id = "unknown";  // colorInteropID: a name of the Color Interop Forum
  std::string space;                   // oiio:ColorSpace; empty: not told
  // x and y of red, green, blue and white; absent: not given.
  std::optional<std::array<float, 8>> chromaticities;
  bool operator==(const PictureColour&) const = default;
};
// Linear light of the primaries of ITU-R BT.709, which are sRGB's.
const PictureColour& linear_rec709();
// For the light from read_radiance(): linear Rec. 709 for a file of sRGB codes, what the header says for an
// EXR, and otherwise, or if the file cannot be read, unknown.
PictureColour colour_of_file(const std::filesystem::path& path, Encoding encoding);

// Which of an EXR's layers read_radiance() uses, if it is not the default one (open_exr.h); otherwise empty.
std::string layer_of_file(const std::filesystem::path& path);

// Linear radiance to .exr (ZIP; 16 or 32 bit floats), .png or .tif/.tiff (8 or 16 bit), by the path's suffix.
// `bits` 0: 32 for EXR, 8 for sRGB, 16 for linear codes. An EXR's header records `colour`. The file is
// written atomically. INVALID_ARGUMENT names the path: a different suffix, or bits that the format does not
// support.
// An EXR has A, which is 1; with `coverage`, of one channel, A is that, and R, G and B are premultiplied. A
// PNG with it has alpha, and its colours are not premultiplied, as PNG requires. INVALID_ARGUMENT: a TIFF
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
// The same of a camera's frame: as stored if the camera has a mosaic. Also DATA_LOSS if that file has more
// than one channel.
absl::StatusOr<Image16> read_frame_file(const std::filesystem::path& path, const FrameShape& expected);

// When a JPEG or TIFF was taken, according to EXIF: "2016:12:09 15:04:09.12"; empty: it does not.
std::string date_taken(std::string_view bytes);

// A photograph in its own codes; gray becomes r = g = b, and alpha is dropped. Its pixels keep the sensor's
// orientation, whatever EXIF says: for a camera that looks down EXIF is unreliable. DATA_LOSS names a file
// that is missing, truncated, has float samples, or has another format.
struct CodedPhotograph {
  Image16 codes;        // 65535 = white; of one channel where there is a mosaic
  int bits = 0;         // per code: the file's 8 or 16, or those of `white`
  bool turned = false;  // EXIF says that the camera was not held upright
  bool raw = false;     // codes are linear (raw_photograph.h)
  // For a raw file, as in v1::Camera.
  std::string mosaic = {};
  double black_level = 0.0;
  // As recorded by the camera.
  std::optional<double> exposure_ms = {}, iso = {};
};
// `white`: the highest code that the camera writes, if the file's own could be higher: 1023 for 10 bits in
// 16. INVALID_ARGUMENT: it is not 1 to the file's highest code, or the photograph has higher ones. A raw file
// contains its own; higher codes are saturated.
absl::StatusOr<CodedPhotograph> read_photograph(const std::filesystem::path& path,
                                                std::optional<int> white = std::nullopt);
// The same from a file's bytes; errors name `path`, whose suffix identifies a raw file.
absl::StatusOr<CodedPhotograph> decode_photograph(const std::filesystem::path& path, std::string_view bytes,
                                                  std::optional<int> white = std::nullopt);
// Raises or lowers a raw file's codes so that this is black: cameras remeasure it with each exposure.
void set_black(double black_level, CodedPhotograph& photograph);
// For viewing: with all colours at each pixel.
Image16 interpolated(const CodedPhotograph& photograph);
// The exposure time recorded in the file; for a raw file only the header is read. None: it is not recorded,
// or the file cannot be read.
std::optional<double> exposure_noted_in(const std::filesystem::path& path);
// The highest code of a file with this many bits.
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
