#include "core/image/image_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <absl/strings/ascii.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <type_traits>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image.h"
#include "core/image/open_exr.h"
#include "core/image/picture_codecs.h"
#include "core/image/picture_header.h"
#include "core/image/radiance_hdr.h"
#include "core/image/raw_photograph.h"
#include "core/image/tiff.h"
#include "core/image/tiff_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::string suffix_of(const fs::path& path) {
  return absl::AsciiStrToLower(path.extension().string());
}

// In b, g, r order; 8, 16 bit or float.
cv::Mat in_three_channels(const cv::Mat& image) {
  if (image.channels() == 3) return image;
  cv::Mat gray, three;
  cv::extractChannel(image, gray, 0);
  cv::cvtColor(image.channels() == 4 ? image : gray, three,
               image.channels() == 4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  return three;
}

// What a camera records about the photograph; without entries if nothing.
TiffDirectory camera_notes(std::string_view bytes) {
  return TiffDirectory(is_tiff(bytes) ? bytes : exif_of(bytes));
}

// Which corner of the picture its first sample is, and along which side its rows lie, as numbered by TIFF
// 6.0.
std::uint64_t orientation_of(std::string_view bytes) {
  return camera_notes(bytes).number(TiffDirectory::kOrientation).value_or(1);
}

// Upright, as it is meant to be seen.
cv::Mat turned(cv::Mat image, std::uint64_t orientation) {
  constexpr int kRows = 0, kColumns = 1;  // of cv::flip
  if (orientation >= 5 && orientation <= 8) {
    cv::transpose(image, image);
    orientation -= 4;
  }
  if (orientation == 2 || orientation == 3) cv::flip(image, image, kColumns);
  if (orientation == 3 || orientation == 4) cv::flip(image, image, kRows);
  return image;
}

enum class Turn { kAsTheSensor, kUpright };

// Three channels in OpenCV's b, g, r order, or the file's own; 8, 16 bit or float.
absl::StatusOr<cv::Mat> decode_any(std::string_view bytes, Turn turn = Turn::kUpright,
                                   int colours = cv::IMREAD_ANYDEPTH | cv::IMREAD_COLOR) {
  GW_RETURN_IF_ERROR(picture_size(bytes).status());
  GW_RETURN_IF_ERROR(check_picture(bytes));
  const TiffDirectory tiff(bytes);
  constexpr std::uint64_t kFloat = 3;  // OpenCV takes it in its own channels alone
  const bool floats = tiff.number(TiffDirectory::kFormat) == kFloat;
  // OpenCV applies a TIFF's orientation in spite of IMREAD_IGNORE_ORIENTATION.
  const std::string as_it_lies = tiff.with_number(TiffDirectory::kOrientation, 1);
  GW_ASSIGN_OR_RETURN(
      cv::Mat image, decode_picture(as_it_lies.empty() ? bytes : as_it_lies,
                                    floats ? cv::IMREAD_UNCHANGED : colours | cv::IMREAD_IGNORE_ORIENTATION));
  if (turn == Turn::kUpright) image = turned(image, orientation_of(bytes));
  if (floats && image.depth() == CV_32F) return in_three_channels(image);
  if (image.depth() != CV_8U && image.depth() != CV_16U)
    return absl::DataLossError("its samples are not 8-bit, 16-bit or float");
  // Codes of 10, 12 or 14 bits, which OpenCV puts at the upper end.
  const std::uint64_t bits = tiff.number(TiffDirectory::kBits).value_or(16);
  if (image.depth() == CV_16U && bits < 16) image *= 65535.0 / (65536 - (65536 >> bits));
  constexpr std::uint64_t kWhiteIsZero = 0;  // OpenCV inverts it only if it has 8 bits
  if (image.depth() == CV_16U && tiff.number(TiffDirectory::kPhotometric) == kWhiteIsZero)
    cv::bitwise_not(image, image);
  return image;
}

// Of one or three channels.
absl::StatusOr<Image16> image16_of(const cv::Mat& mat) {
  if (mat.depth() == CV_32F) return absl::DataLossError("its samples are float; frames have 8 or 16 bit");
  const int channels = mat.channels();
  Image16 image(mat.cols, mat.rows, channels);
  for (int y = 0; y < mat.rows; ++y) {
    for (int x = 0; x < mat.cols; ++x) {
      for (int c = 0; c < channels; ++c) {
        const int at = x * channels + channels - 1 - c;
        image.at(x, y, c) = mat.depth() == CV_16U
                                ? mat.ptr<std::uint16_t>(y)[at]
                                : static_cast<std::uint16_t>(mat.ptr<std::uint8_t>(y)[at] * 257);
      }
    }
  }
  return image;
}

absl::Status named(const fs::path& path, const absl::Status& status) {
  if (status.ok()) return status;
  return absl::Status(status.code(), fmt::format("{}: {}", path.string(), std::string(status.message())));
}

Imf::Header exr_header(const RadianceImage& image, const PictureColour& colour) {
  Imf::Header header(image.width_px, image.height_px);
  header.compression() = Imf::ZIP_COMPRESSION;
  if (colour.chromaticities) {
    const auto& [rx, ry, gx, gy, bx, by, wx, wy] = *colour.chromaticities;
    Imf::addChromaticities(header, Imf::Chromaticities({rx, ry}, {gx, gy}, {bx, by}, {wx, wy}));
  }
  if (!colour.space.empty()) header.insert(kOiioSpace, Imf::StringAttribute(colour.space));
  header.insert(kInteropId, Imf::StringAttribute(colour.interop_id));
  return header;
}

// Row by row, since the layer is as large as the picture.
template <typename Sample>  // float or Imath::half
void write_layer(Imf::OStream& bytes, Imf::Header header, const RadianceImage& image,
                 const RadianceImage* coverage) {
  constexpr size_t kSamples = 4;
  constexpr std::array kNames{"R", "G", "B", "A"};
  constexpr Imf::PixelType kType = std::is_same_v<Sample, float> ? Imf::FLOAT : Imf::HALF;
  const size_t width = image.width_px;
  std::vector<float> layer(kSamples * width);
  std::vector<Sample> row(layer.size());
  Imf::FrameBuffer buffer;
  for (size_t c = 0; c < kSamples; ++c) {
    header.channels().insert(kNames[c], Imf::Channel(kType));
    buffer.insert(kNames[c],
                  Imf::Slice(kType, reinterpret_cast<char*>(row.data() + c), kSamples * sizeof(Sample), 0));
  }
  Imf::OutputFile file(bytes, header);
  file.setFrameBuffer(buffer);
  for (size_t y = 0; y < static_cast<size_t>(image.height_px); ++y) {
    const std::span light(image.samples.data() + 3 * width * y, 3 * width);
    premultiply(light,
                coverage ? std::span(coverage->samples.data() + width * y, width) : std::span<const float>(),
                layer);
    std::ranges::copy(layer, row.begin());
    file.writePixels(1);
  }
}

absl::StatusOr<std::string> encode_exr(const RadianceImage& image, bool half, const PictureColour& colour,
                                       const RadianceImage* coverage) {
  try {
    Imf::StdOSStream bytes;
    const Imf::Header header = exr_header(image, colour);
    half ? write_layer<Imath::half>(bytes, header, image, coverage)
         : write_layer<float>(bytes, header, image, coverage);
    return bytes.str();
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("the picture cannot be encoded: {}", error.what()));
  }
}

cv::Mat mat16_of(const Image16& image) {
  cv::Mat mat(image.height_px, image.width_px, CV_16UC3);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      for (int c = 0; c < 3; ++c) mat.at<cv::Vec3w>(y, x)[2 - c] = image.at(x, y, c);
    }
  }
  return mat;
}

// `Sample` is std::uint8_t or std::uint16_t.
template <typename Sample>
cv::Mat codes_of(const RadianceImage& image, Encoding encoding, const RadianceImage* coverage = nullptr) {
  constexpr float kWhite = std::numeric_limits<Sample>::max();
  const int channels = coverage ? 4 : 3;
  cv::Mat mat(image.height_px, image.width_px, CV_MAKETYPE(cv::DataType<Sample>::depth, channels));
  for (int y = 0; y < image.height_px; ++y) {
    auto* pixel = mat.ptr<Sample>(y);
    for (int x = 0; x < image.width_px; ++x, pixel += channels) {
      for (int c = 0; c < 3; ++c) {
        const float light = image.at(x, y, c);
        pixel[2 - c] = cv::saturate_cast<Sample>(
            kWhite * (encoding == Encoding::kLinear ? light : srgb_of_linear(light)));
      }
      if (coverage) pixel[3] = cv::saturate_cast<Sample>(kWhite * coverage->at(x, y, 0));
    }
  }
  return mat;
}

}  // namespace

float srgb_of_linear(float light) {
  const float x = std::clamp(light, 0.0f, 1.0f);
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
}

float linear_of_srgb(float code) {
  return code <= 0.04045f ? code / 12.92f : std::pow((code + 0.055f) / 1.055f, 2.4f);
}

const std::array<float, 256>& light_of_srgb_codes() {
  static const std::array<float, 256> kLight = [] {
    std::array<float, 256> light{};
    for (size_t code = 0; code < 256; ++code) light[code] = linear_of_srgb(static_cast<float>(code) / 255.0f);
    return light;
  }();
  return kLight;
}

const PictureColour& linear_rec709() {
  static const PictureColour kColour{
      .interop_id = "lin_rec709_scene",
      .space = "lin_rec709",
      .chromaticities = {{0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f}}};
  return kColour;
}

PictureColour colour_of_file(const fs::path& path, Encoding encoding) {
  const std::string suffix = suffix_of(path);
  if (suffix == ".hdr" || (suffix != ".exr" && encoding == Encoding::kLinear)) return {};
  if (suffix != ".exr") return linear_rec709();
  return colour_of_open_exr(path);
}

std::string layer_of_file(const fs::path& path) {
  return suffix_of(path) == ".exr" ? layer_of_open_exr(path) : "";
}

absl::StatusOr<RadianceImage> decode_radiance(std::string_view bytes, Encoding encoding) {
  if (is_hdr(bytes)) return decode_hdr(bytes);
  GW_ASSIGN_OR_RETURN(const cv::Mat mat, decode_any(bytes));
  const bool coded = encoding == Encoding::kDisplay;
  RadianceImage image(mat.cols, mat.rows);
  for (int y = 0; y < mat.rows; ++y) {
    for (int x = 0; x < mat.cols; ++x) {
      for (int c = 0; c < 3; ++c) {
        float& light = image.at(x, y, c);
        if (mat.depth() == CV_8U) {
          const std::uint8_t code = mat.at<cv::Vec3b>(y, x)[2 - c];
          light = coded ? light_of_srgb_codes()[code] : static_cast<float>(code) / 255.0f;
        } else if (mat.depth() == CV_16U) {
          const float value = static_cast<float>(mat.at<cv::Vec3w>(y, x)[2 - c]) / 65535.0f;
          light = coded ? linear_of_srgb(value) : value;
        } else if (mat.depth() == CV_32F) {
          light = mat.at<cv::Vec3f>(y, x)[2 - c];
        }
      }
    }
  }
  return image;
}

absl::StatusOr<RadianceImage> read_radiance(const fs::path& path, Encoding encoding) {
  if (suffix_of(path) == ".exr") {
    if (!fs::exists(path)) return absl::NotFoundError(fmt::format("there is no file {}", path.string()));
    return read_open_exr(path);
  }
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  absl::StatusOr<RadianceImage> image = decode_radiance(bytes, encoding);
  if (!image.ok()) return named(path, image.status());
  return image;
}

absl::Status check_picture_file(const fs::path& path, int bits, bool with_coverage) {
  const std::string suffix = suffix_of(path);
  const bool floats = suffix == ".exr";
  if (!floats && suffix != ".png" && suffix != ".tif" && suffix != ".tiff") {
    return absl::InvalidArgumentError(
        fmt::format("{} ends in \"{}\"; it must be .exr, .png, .tif or .tiff", path.string(), suffix));
  }
  if (with_coverage && !floats && suffix != ".png") {
    return absl::InvalidArgumentError(fmt::format("{} cannot have alpha; use .exr or .png", path.string()));
  }
  if (bits == 0 || bits == 16 || bits == (floats ? 32 : 8)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is to have {} bits; {}", path.string(), bits,
                  floats ? "an EXR has 16 or 32" : "PNG and TIFF have 8 or 16"));
}

absl::StatusOr<std::string> encode_radiance(const fs::path& name, const RadianceImage& image,
                                            Encoding encoding, int bits, const PictureColour& colour,
                                            const RadianceImage* coverage) {
  GW_RETURN_IF_ERROR(check_picture_file(name, bits, coverage != nullptr));
  const std::string suffix = suffix_of(name);
  if (suffix == ".exr") return encode_exr(image, bits == 16, colour, coverage);
  if (bits == 0) bits = encoding == Encoding::kLinear ? 16 : 8;
  return encode_picture(suffix, bits == 16 ? codes_of<std::uint16_t>(image, encoding, coverage)
                                           : codes_of<std::uint8_t>(image, encoding, coverage));
}

absl::Status write_radiance(const fs::path& path, const RadianceImage& image, Encoding encoding, int bits,
                            const PictureColour& colour) {
  const absl::StatusOr<std::string> bytes = encode_radiance(path, image, encoding, bits, colour);
  if (absl::IsInvalidArgument(bytes.status())) return bytes.status();  // names it
  if (!bytes.ok()) return named(path, bytes.status());
  return write_file_durably(path, *bytes);
}

absl::Status write_srgb8(const fs::path& path, std::span<const std::uint8_t> codes, int width_px,
                         int height_px) {
  cv::Mat mat(height_px, width_px, CV_8UC3);
  for (size_t i = 0; i < codes.size(); ++i) mat.data[i / 3 * 3 + 2 - i % 3] = codes[i];
  const absl::StatusOr<std::string> bytes = encode_picture(".png", mat);
  if (!bytes.ok()) return named(path, bytes.status());
  GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(path));
  return file.add(*bytes);
}

namespace {

// The file's bytes, of a picture of this size.
absl::StatusOr<std::string> read_picture_bytes(const fs::path& path, std::optional<PictureSize> expected) {
  absl::StatusOr<std::string> bytes = read_file(path);
  if (absl::IsNotFound(bytes.status()))
    return absl::DataLossError(fmt::format("{}: the frame is missing", path.string()));
  GW_RETURN_IF_ERROR(bytes.status());
  const absl::StatusOr<PictureSize> size = picture_size(*bytes);
  if (!size.ok()) return named(path, size.status());
  if (expected && *size != *expected) {
    return absl::DataLossError(fmt::format("{} is {}x{}; the manifest says that frames are {}x{}",
                                           path.string(), size->width_px, size->height_px, expected->width_px,
                                           expected->height_px));
  }
  return bytes;
}

absl::StatusOr<Image16> decode_frame(const fs::path& path, std::string_view bytes, int colours) {
  if (orientation_of(bytes) > 1)
    return absl::DataLossError(
        fmt::format("{} is rotated; a frame's first row must be its top", path.string()));
  const absl::StatusOr<cv::Mat> mat = decode_any(bytes, Turn::kAsTheSensor, colours);
  if (!mat.ok()) return named(path, mat.status());
  if (mat->channels() != 1 && mat->channels() != 3) {
    return absl::DataLossError(
        fmt::format("{} has {} channels; a frame of a mosaic has one", path.string(), mat->channels()));
  }
  absl::StatusOr<Image16> image = image16_of(*mat);
  return image.ok() ? image : named(path, image.status());
}

}  // namespace

absl::StatusOr<Image16> read_frame_file(const fs::path& path, std::optional<PictureSize> expected) {
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_picture_bytes(path, expected));
  absl::StatusOr<Image16> own = decode_tiff(bytes);
  if (own.ok() && own->channels == 3) return own;
  return decode_frame(path, bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_COLOR);
}

absl::StatusOr<Image16> read_frame_file(const fs::path& path, const FrameShape& expected) {
  const PictureSize size{expected.width_px, expected.height_px};
  if (expected.channels == 3) return read_frame_file(path, size);
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_picture_bytes(path, size));
  absl::StatusOr<Image16> image = decode_tiff(bytes);
  if (!image.ok()) {
    GW_ASSIGN_OR_RETURN(image, decode_frame(path, bytes, cv::IMREAD_UNCHANGED));
  }
  if (image->channels == 1) return image;
  return absl::DataLossError(fmt::format(
      "{} has r, g, b; the manifest says that frames are a mosaic, of one channel", path.string()));
}

namespace {

// Makes `white` 65535.
absl::Status stretch(int white, CodedPhotograph& photograph) {
  const int highest = highest_code(photograph.bits), step = 65535 / highest;
  if (white < 1 || white > highest) {
    return absl::InvalidArgumentError(fmt::format(
        "white is code {}; it must be 1 to {}, the highest of {} bits", white, highest, photograph.bits));
  }
  const int largest = *std::ranges::max_element(photograph.codes.samples) / step;
  if (largest > white)
    return absl::InvalidArgumentError(fmt::format("its largest code is {}, above white, {}", largest, white));
  for (std::uint16_t& sample : photograph.codes.samples) {
    const int code = sample / step;
    sample = code16_of(static_cast<float>(code) / static_cast<float>(white));
  }
  // Codes of fewer bits may be stored at the upper end: 65520 is 4095, 12 bits.
  const auto ones = static_cast<unsigned>(white) >> std::countr_zero(static_cast<unsigned>(white));
  photograph.bits = std::bit_width(std::has_single_bit(ones + 1) ? ones : static_cast<unsigned>(white));
  return absl::OkStatus();
}

}  // namespace

std::string date_taken(std::string_view bytes) {
  const TiffDirectory exif = camera_notes(bytes).inner(TiffDirectory::kExif);
  const std::string date = exif.text(TiffDirectory::kDateTaken);
  return date.empty() ? "" : date + "." + exif.text(TiffDirectory::kSubsecondTaken);
}

namespace {

std::optional<double> exposure_ms_of(const TiffDirectory& exif) {
  const std::optional<double> seconds = exif.ratio(TiffDirectory::kExposureTime);
  return seconds && *seconds > 0.0 ? std::optional(1e3 * *seconds) : std::nullopt;
}

absl::StatusOr<CodedPhotograph> photograph_of_raw(std::string_view bytes) {
  GW_ASSIGN_OR_RETURN(RawPhotograph raw, decode_raw(bytes));
  const auto white = static_cast<float>(raw.white);
  for (std::uint16_t& code : raw.codes.samples) code = code16_of(static_cast<float>(code) / white);
  CodedPhotograph photograph{.codes = std::move(raw.codes),
                             .bits = static_cast<int>(std::bit_width(static_cast<unsigned>(raw.white))),
                             .turned = raw.facts.turned,
                             .raw = true,
                             .mosaic = raw.mosaic,
                             .black_level = static_cast<double>(raw.black) / raw.white,
                             .exposure_ms = raw.facts.exposure_ms,
                             .iso = raw.facts.iso};
  if (!photograph.mosaic.empty()) return photograph;
  Image16 gray(photograph.codes.width_px, photograph.codes.height_px);
  for (size_t i = 0; i < gray.samples.size(); ++i) gray.samples[i] = photograph.codes.samples[i / 3];
  photograph.codes = std::move(gray);
  return photograph;
}

}  // namespace

std::optional<double> exposure_noted_in(const fs::path& path) {
  const absl::StatusOr<std::string> bytes = read_file(path);
  if (!bytes.ok()) return std::nullopt;
  if (!is_raw_file(path)) return exposure_ms_of(camera_notes(*bytes).inner(TiffDirectory::kExif));
  const absl::StatusOr<RawFacts> facts = read_raw_facts(*bytes);
  return facts.ok() ? facts->exposure_ms : std::nullopt;
}

absl::StatusOr<CodedPhotograph> read_photograph(const fs::path& path, std::optional<int> white) {
  const absl::StatusOr<std::string> bytes = read_file(path);
  if (absl::IsNotFound(bytes.status()))
    return absl::DataLossError(fmt::format("{}: the photograph is missing", path.string()));
  GW_RETURN_IF_ERROR(bytes.status());
  return decode_photograph(path, *bytes, white);
}

absl::StatusOr<CodedPhotograph> decode_photograph(const fs::path& path, std::string_view bytes,
                                                  std::optional<int> white) {
  if (is_raw_file(path) && !is_jpeg(bytes) && !is_png(bytes)) {
    absl::StatusOr<CodedPhotograph> raw = photograph_of_raw(bytes);
    return raw.ok() ? std::move(raw) : named(path, raw.status());
  }
  const absl::StatusOr<cv::Mat> mat = decode_any(bytes, Turn::kAsTheSensor);
  if (!mat.ok()) return named(path, mat.status());
  absl::StatusOr<Image16> codes = image16_of(*mat);
  if (!codes.ok()) return named(path, codes.status());
  const TiffDirectory exif = camera_notes(bytes).inner(TiffDirectory::kExif);
  CodedPhotograph photograph{.codes = *std::move(codes),
                             .bits = mat->depth() == CV_16U ? 16 : 8,
                             .turned = orientation_of(bytes) > 1,
                             .exposure_ms = exposure_ms_of(exif)};
  if (const auto iso = exif.number(TiffDirectory::kIso)) photograph.iso = static_cast<double>(*iso);
  if (white) GW_RETURN_IF_ERROR(named(path, stretch(*white, photograph)));
  return photograph;
}

void set_black(double black_level, CodedPhotograph& photograph) {
  const auto raise = static_cast<int>(std::lround(65535.0 * (black_level - photograph.black_level)));
  photograph.black_level = black_level;
  if (raise == 0) return;
  for (std::uint16_t& sample : photograph.codes.samples)
    sample = static_cast<std::uint16_t>(std::clamp(sample + raise, 0, 65535));
}

Image16 interpolated(const CodedPhotograph& photograph) {
  const absl::StatusOr<Mosaic> mosaic = Mosaic::parse(photograph.mosaic);
  return interpolated(photograph.codes, mosaic.ok() ? std::optional(*mosaic) : std::nullopt);
}

absl::StatusOr<std::string> encode_png16(const Image16& image) {
  return encode_picture(".png", mat16_of(image));
}

absl::StatusOr<std::string> encode_jpeg(const RadianceImage& image) {
  return encode_picture(".jpg", codes_of<std::uint8_t>(image, Encoding::kDisplay));
}

absl::StatusOr<Image16> decode_png(std::string_view bytes) {
  if (!is_png(bytes)) return absl::InvalidArgumentError("it is not a PNG");
  const absl::StatusOr<cv::Mat> mat = decode_any(bytes);
  if (absl::IsDataLoss(mat.status())) return absl::InvalidArgumentError(mat.status().message());
  GW_RETURN_IF_ERROR(mat.status());
  return image16_of(*mat);
}

RadianceImage resized(const RadianceImage& image, int width_px, int height_px) {
  if (image.width_px == width_px && image.height_px == height_px) return image;
  RadianceImage out(width_px, height_px);
  const cv::Mat from(image.height_px, image.width_px, CV_32FC3, const_cast<float*>(image.samples.data()));
  cv::Mat to(height_px, width_px, CV_32FC3, out.samples.data()), less;
  cv::resize(from, less, {std::min(width_px, image.width_px), std::min(height_px, image.height_px)}, 0, 0,
             cv::INTER_AREA);
  cv::resize(less, to, to.size(), 0, 0, cv::INTER_LINEAR);
  return out;
}

}  // namespace glasswing
