#include "core/frame/image_file.h"

#include <ImathBox.h>
#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfRgbaFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/frame/jpeg_header.h"
#include "core/frame/picture_codecs.h"
#include "core/frame/radiance_hdr.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::string suffix_of(const fs::path& path) {
  std::string suffix = path.extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](char c) { return static_cast<char>(std::tolower(c)); });
  return suffix;
}

// libpng only warns about damage, so every chunk's CRC is checked here, up to and including IEND.
absl::Status check_png(std::string_view bytes) {
  const auto word = [&](size_t at) {
    std::uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  size_t at = 8;
  while (bytes.size() >= at + 12) {
    const size_t length = word(at);
    if (length > bytes.size() - at - 12) break;
    const auto* chunk = reinterpret_cast<const Bytef*>(&bytes[at + 4]);
    if (crc32(0, chunk, static_cast<uInt>(length + 4)) != word(at + 8 + length)) {
      return absl::DataLossError("a PNG chunk's CRC is wrong");
    }
    if (bytes.substr(at + 4, 4) == "IEND") return absl::OkStatus();
    at += length + 12;
  }
  return absl::DataLossError("the PNG is truncated");
}

bool is_png(std::string_view bytes) {
  return bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n";
}

// Reads numbers in the file's byte order.
class TiffReader {
 public:
  explicit TiffReader(std::string_view bytes) : bytes_(bytes), big_(bytes.substr(0, 2) == "MM") {}
  std::optional<std::uint32_t> number(size_t at, size_t size) const {
    if (at > bytes_.size() || bytes_.size() - at < size) return std::nullopt;
    std::uint32_t value = 0;
    for (size_t i = 0; i < size; ++i) {
      value = value << 8 | static_cast<unsigned char>(bytes_[big_ ? at + i : at + size - 1 - i]);
    }
    return value;
  }

 private:
  std::string_view bytes_;
  bool big_;
};

// The size of the first picture in a TIFF 6.0; 0x0 if there is none.
PictureSize tiff_size(std::string_view bytes) {
  constexpr std::uint32_t kWidth = 256, kHeight = 257, kShort = 3, kLong = 4;
  const TiffReader tiff(bytes);
  PictureSize size;
  if (tiff.number(2, 2) != 42u) return size;
  const std::uint32_t directory = tiff.number(4, 4).value_or(0);
  const std::uint32_t count = tiff.number(directory, 2).value_or(0);
  for (size_t at = size_t{directory} + 2, i = 0; i < count; ++i, at += 12) {
    const auto tag = tiff.number(at, 2), type = tiff.number(at + 2, 2);
    if (tag != kWidth && tag != kHeight) continue;
    if (type != kShort && type != kLong) return {};
    const std::uint32_t value = tiff.number(at + 8, type == kShort ? 2 : 4).value_or(0);
    int& side = tag == kWidth ? size.width_px : size.height_px;
    if (side != 0) return {};  // a duplicate tag is ambiguous
    side = static_cast<int>(std::min<std::uint32_t>(value, std::numeric_limits<int>::max()));
  }
  return size;
}

PictureSize png_size(std::string_view bytes) {
  constexpr size_t kWidthAt = 16, kHeightAt = 20, kEnd = 24;
  if (bytes.size() < kEnd || bytes.substr(12, 4) != "IHDR") return {};
  const auto side = [&bytes](size_t at) {
    std::uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return static_cast<int>(std::min<std::uint32_t>(value, std::numeric_limits<int>::max()));
  };
  return {.width_px = side(kWidthAt), .height_px = side(kHeightAt)};
}

// Three channels in OpenCV's b, g, r order, or the file's own; 8, 16 bit or float.
absl::StatusOr<cv::Mat> decode_any(std::string_view bytes,
                                   int flags = cv::IMREAD_ANYDEPTH | cv::IMREAD_COLOR) {
  if (bytes.empty()) return absl::DataLossError("it is empty");
  GW_RETURN_IF_ERROR(picture_size(bytes).status());
  if (is_png(bytes)) GW_RETURN_IF_ERROR(check_png(bytes));
  if (is_jpeg(bytes)) GW_RETURN_IF_ERROR(check_jpeg(bytes));
  GW_ASSIGN_OR_RETURN(cv::Mat image, decode_picture(bytes, flags));
  if (image.depth() != CV_8U && image.depth() != CV_16U && image.depth() != CV_32F) {
    return absl::DataLossError("its samples are not 8-bit, 16-bit or float");
  }
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

constexpr const char* kOiioSpace = "oiio:ColorSpace";
constexpr const char* kInteropId = "colorInteropID";

PictureColour colour_in(const Imf::Header& header) {
  PictureColour colour;
  if (const auto* id = header.findTypedAttribute<Imf::StringAttribute>(kInteropId))
    colour.interop_id = id->value();
  if (const auto* space = header.findTypedAttribute<Imf::StringAttribute>(kOiioSpace))
    colour.space = space->value();
  if (Imf::hasChromaticities(header)) {
    const auto& [red, green, blue, white] = Imf::chromaticities(header);
    colour.chromaticities = {red.x, red.y, green.x, green.y, blue.x, blue.y, white.x, white.y};
    // Where a file has nothing but these, its samples are linear, as OpenEXR says of them.
    if (colour.chromaticities == linear_rec709().chromaticities && colour.interop_id == "unknown" &&
        colour.space.empty())
      return linear_rec709();
  }
  return colour;
}

constexpr size_t kRgb = 3;

// Of a file's first part; 0 where it has no channel of a name.
void read_channels(Imf::InputFile& file, const std::array<const char*, kRgb>& names, RadianceImage& image) {
  const Imath::Box2i window = file.header().dataWindow();
  constexpr size_t kPixel = kRgb * sizeof(float);
  Imf::FrameBuffer frame;
  for (size_t c = 0; c < names.size(); ++c) {
    frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.samples.data() + c, window, kPixel,
                                            kPixel * static_cast<size_t>(image.width_px)));
  }
  file.setFrameBuffer(frame);
  file.readPixels(window.min.y, window.max.y);
}

// Luminance and chroma, as halves.
void read_luma(const fs::path& path, RadianceImage& image) {
  Imf::RgbaInputFile file(path.c_str());
  const Imath::Box2i window = file.dataWindow();
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
}

absl::StatusOr<RadianceImage> read_exr(const fs::path& path) {
  try {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    RadianceImage image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1);
    const Imf::ChannelList& channels = file.header().channels();
    const bool luminance = channels.findChannel("Y") != nullptr;
    if (luminance && channels.findChannel("RY") != nullptr) {
      read_luma(path, image);
    } else {
      read_channels(file, {luminance ? "Y" : "R", "G", "B"}, image);
      for (size_t i = 0; luminance && i < image.samples.size(); i += kRgb)
        image.samples[i + 1] = image.samples[i + 2] = image.samples[i];
    }
    for (const float sample : image.samples) {
      if (!std::isfinite(sample))
        return absl::DataLossError(path.string() + ": it holds values that are not finite");
    }
    return image;
  } catch (const std::exception& error) {
    return absl::DataLossError(fmt::format("{}: {}", path.string(), error.what()));
  }
}

absl::Status write_exr(const fs::path& path, const RadianceImage& image, bool half,
                       const PictureColour& colour) {
  const fs::path partial = fmt::format("{}.{}.tmp", path.string(), ::getpid());
  try {
    Imf::Header header(image.width_px, image.height_px);
    header.compression() = Imf::ZIP_COMPRESSION;
    if (colour.chromaticities) {
      const auto& [rx, ry, gx, gy, bx, by, wx, wy] = *colour.chromaticities;
      Imf::addChromaticities(header, Imf::Chromaticities({rx, ry}, {gx, gy}, {bx, by}, {wx, wy}));
    }
    if (!colour.space.empty()) header.insert(kOiioSpace, Imf::StringAttribute(colour.space));
    header.insert(kInteropId, Imf::StringAttribute(colour.interop_id));
    std::vector<Imath::half> halves(half ? image.samples.size() : 0);
    std::ranges::transform(image.samples.begin(),
                           image.samples.begin() + static_cast<std::ptrdiff_t>(halves.size()), halves.begin(),
                           [](float light) { return Imath::half(light); });
    const Imf::PixelType type = half ? Imf::HALF : Imf::FLOAT;
    const size_t sample = half ? sizeof(Imath::half) : sizeof(float), pixel = 3 * sample;
    auto* samples = half ? reinterpret_cast<char*>(halves.data())
                         : reinterpret_cast<char*>(const_cast<float*>(image.samples.data()));
    Imf::FrameBuffer buffer;
    for (int c = 0; c < 3; ++c) {
      const char* name = c == 0 ? "R" : c == 1 ? "G" : "B";
      header.channels().insert(name, Imf::Channel(type));
      buffer.insert(name, Imf::Slice(type, samples + static_cast<size_t>(c) * sample, pixel,
                                     pixel * static_cast<size_t>(image.width_px)));
    }
    {
      Imf::OutputFile file(partial.c_str(), header);
      file.setFrameBuffer(buffer);
      file.writePixels(image.height_px);
    }
    return place_file_durably(partial, path);
  } catch (const std::exception& error) {
    std::error_code ignored;
    fs::remove(partial, ignored);
    return absl::UnavailableError(fmt::format("cannot write {}: {}", path.string(), error.what()));
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
cv::Mat codes_of(const RadianceImage& image, Encoding encoding) {
  using Pixel = cv::Vec<Sample, 3>;
  constexpr float kWhite = std::numeric_limits<Sample>::max();
  cv::Mat mat(image.height_px, image.width_px, cv::traits::Type<Pixel>::value);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float light = image.at(x, y, c);
        mat.at<Pixel>(y, x)[2 - c] = cv::saturate_cast<Sample>(
            kWhite * (encoding == Encoding::kLinear ? light : srgb_of_linear(light)));
      }
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
  try {
    return colour_in(Imf::RgbaInputFile(path.c_str()).header());
  } catch (const std::exception&) {
    return {};
  }
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
    return read_exr(path);
  }
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  absl::StatusOr<RadianceImage> image = decode_radiance(bytes, encoding);
  if (!image.ok()) return named(path, image.status());
  return image;
}

absl::Status check_picture_file(const fs::path& path, int bits) {
  const std::string suffix = suffix_of(path);
  const bool floats = suffix == ".exr";
  if (!floats && suffix != ".png" && suffix != ".tif" && suffix != ".tiff") {
    return absl::InvalidArgumentError(
        fmt::format("{} ends in \"{}\"; it must be .exr, .png, .tif or .tiff", path.string(), suffix));
  }
  if (bits == 0 || bits == 16 || bits == (floats ? 32 : 8)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is to have {} bits; {}", path.string(), bits,
                  floats ? "an EXR has 16 or 32" : "PNG and TIFF have 8 or 16"));
}

absl::Status write_radiance(const fs::path& path, const RadianceImage& image, Encoding encoding, int bits,
                            const PictureColour& colour) {
  GW_RETURN_IF_ERROR(check_picture_file(path, bits));
  const std::string suffix = suffix_of(path);
  if (suffix == ".exr") return write_exr(path, image, bits == 16, colour);
  if (bits == 0) bits = encoding == Encoding::kLinear ? 16 : 8;
  const absl::StatusOr<std::string> bytes =
      encode_picture(suffix, bits == 16 ? codes_of<std::uint16_t>(image, encoding)
                                        : codes_of<std::uint8_t>(image, encoding));
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

absl::StatusOr<PictureSize> picture_size(std::string_view bytes) {
  const bool tiff = bytes.substr(0, 2) == "II" || bytes.substr(0, 2) == "MM";
  if (!tiff && !is_png(bytes) && !is_jpeg(bytes)) return absl::DataLossError("it is not a PNG, JPEG or TIFF");
  const PictureSize size = tiff ? tiff_size(bytes) : is_png(bytes) ? png_size(bytes) : jpeg_size(bytes);
  const auto good = [](int side) { return side >= 1 && side <= kMaxSide_px; };
  if (good(size.width_px) && good(size.height_px)) return size;
  return absl::DataLossError(fmt::format("its header says {}x{}; each side must be 1 to {} px", size.width_px,
                                         size.height_px, kMaxSide_px));
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

absl::StatusOr<Image16> decode_frame(const fs::path& path, std::string_view bytes, int flags) {
  const absl::StatusOr<cv::Mat> mat = decode_any(bytes, flags);
  if (!mat.ok()) return named(path, mat.status());
  if (mat->channels() != 1 && mat->channels() != 3) {
    return absl::DataLossError(
        fmt::format("{} has {} channels; a frame of a mosaic has one", path.string(), mat->channels()));
  }
  absl::StatusOr<Image16> image = image16_of(*mat);
  if (!image.ok()) return named(path, image.status());
  if (PictureSize{image->width_px, image->height_px} != *picture_size(bytes))
    return absl::DataLossError(
        fmt::format("{} is rotated; a frame's first row must be its top", path.string()));
  return image;
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

absl::StatusOr<CodedPhotograph> read_photograph(const fs::path& path) {
  const absl::StatusOr<std::string> bytes = read_file(path);
  if (absl::IsNotFound(bytes.status()))
    return absl::DataLossError(fmt::format("{}: the photograph is missing", path.string()));
  GW_RETURN_IF_ERROR(bytes.status());
  const absl::StatusOr<cv::Mat> mat = decode_any(*bytes);
  if (!mat.ok()) return named(path, mat.status());
  absl::StatusOr<Image16> codes = image16_of(*mat);
  if (!codes.ok()) return named(path, codes.status());
  return CodedPhotograph{.codes = *std::move(codes), .bits = mat->depth() == CV_16U ? 16 : 8};
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
