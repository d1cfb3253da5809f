#include "camera-node/backends/pixel_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "core/base/status.h"
#include "core/image/picture_codecs.h"
#include "core/image/picture_header.h"

namespace glasswing {
namespace {

using Kind = PixelFormat::Kind;
using Packing = PixelFormat::Packing;
using Transfer = ColourCode::Transfer;

constexpr PixelFormat kFormats[] = {
    {"SRGGB16", Kind::kBayer, "RGGB", 16},
    {"SGRBG16", Kind::kBayer, "GRBG", 16},
    {"SGBRG16", Kind::kBayer, "GBRG", 16},
    {"SBGGR16", Kind::kBayer, "BGGR", 16},
    {"SRGGB12", Kind::kBayer, "RGGB", 12},
    {"SGRBG12", Kind::kBayer, "GRBG", 12},
    {"SGBRG12", Kind::kBayer, "GBRG", 12},
    {"SBGGR12", Kind::kBayer, "BGGR", 12},
    {"SRGGB12_CSI2P", Kind::kBayer, "RGGB", 12, Packing::kCsi2},
    {"SGRBG12_CSI2P", Kind::kBayer, "GRBG", 12, Packing::kCsi2},
    {"SGBRG12_CSI2P", Kind::kBayer, "GBRG", 12, Packing::kCsi2},
    {"SBGGR12_CSI2P", Kind::kBayer, "BGGR", 12, Packing::kCsi2},
    {"SRGGB10", Kind::kBayer, "RGGB", 10},
    {"SGRBG10", Kind::kBayer, "GRBG", 10},
    {"SGBRG10", Kind::kBayer, "GBRG", 10},
    {"SBGGR10", Kind::kBayer, "BGGR", 10},
    {"SRGGB10_CSI2P", Kind::kBayer, "RGGB", 10, Packing::kCsi2},
    {"SGRBG10_CSI2P", Kind::kBayer, "GRBG", 10, Packing::kCsi2},
    {"SGBRG10_CSI2P", Kind::kBayer, "GBRG", 10, Packing::kCsi2},
    {"SBGGR10_CSI2P", Kind::kBayer, "BGGR", 10, Packing::kCsi2},
    {"SRGGB8", Kind::kBayer, "RGGB", 8},
    {"SGRBG8", Kind::kBayer, "GRBG", 8},
    {"SGBRG8", Kind::kBayer, "GBRG", 8},
    {"SBGGR8", Kind::kBayer, "BGGR", 8},
    {"R12", Kind::kGray, "R", 12},
    {"R10", Kind::kGray, "R", 10},
    {"R10_CSI2P", Kind::kGray, "R", 10, Packing::kCsi2},
    {"R8", Kind::kGray, "R", 8},
    {"RGB888", Kind::kRgb, "BGR", 8},
    {"BGR888", Kind::kRgb, "RGB", 8},
    {"XRGB8888", Kind::kRgb, "BGRX", 8},
    {"XBGR8888", Kind::kRgb, "RGBX", 8},
    {"YUYV", Kind::kYuv422, "YUYV", 8},
    {"UYVY", Kind::kYuv422, "UYVY", 8},
    {"NV12", Kind::kNv12, "YUV", 8},
    {"MJPEG", Kind::kJpeg, "", 8},
    // GenICam's.
    {"BayerRG16", Kind::kBayer, "RGGB", 16},
    {"BayerGR16", Kind::kBayer, "GRBG", 16},
    {"BayerGB16", Kind::kBayer, "GBRG", 16},
    {"BayerBG16", Kind::kBayer, "BGGR", 16},
    {"BayerRG12", Kind::kBayer, "RGGB", 12},
    {"BayerRG12p", Kind::kBayer, "RGGB", 12, Packing::kBits},
    {"BayerRG12Packed", Kind::kBayer, "RGGB", 12, Packing::kGige},
    {"BayerGR12", Kind::kBayer, "GRBG", 12},
    {"BayerGR12p", Kind::kBayer, "GRBG", 12, Packing::kBits},
    {"BayerGR12Packed", Kind::kBayer, "GRBG", 12, Packing::kGige},
    {"BayerGB12", Kind::kBayer, "GBRG", 12},
    {"BayerGB12p", Kind::kBayer, "GBRG", 12, Packing::kBits},
    {"BayerGB12Packed", Kind::kBayer, "GBRG", 12, Packing::kGige},
    {"BayerBG12", Kind::kBayer, "BGGR", 12},
    {"BayerBG12p", Kind::kBayer, "BGGR", 12, Packing::kBits},
    {"BayerBG12Packed", Kind::kBayer, "BGGR", 12, Packing::kGige},
    {"BayerRG10", Kind::kBayer, "RGGB", 10},
    {"BayerRG10p", Kind::kBayer, "RGGB", 10, Packing::kBits},
    {"BayerRG10Packed", Kind::kBayer, "RGGB", 10, Packing::kGige},
    {"BayerGR10", Kind::kBayer, "GRBG", 10},
    {"BayerGR10p", Kind::kBayer, "GRBG", 10, Packing::kBits},
    {"BayerGR10Packed", Kind::kBayer, "GRBG", 10, Packing::kGige},
    {"BayerGB10", Kind::kBayer, "GBRG", 10},
    {"BayerGB10p", Kind::kBayer, "GBRG", 10, Packing::kBits},
    {"BayerGB10Packed", Kind::kBayer, "GBRG", 10, Packing::kGige},
    {"BayerBG10", Kind::kBayer, "BGGR", 10},
    {"BayerBG10p", Kind::kBayer, "BGGR", 10, Packing::kBits},
    {"BayerBG10Packed", Kind::kBayer, "BGGR", 10, Packing::kGige},
    {"BayerRG8", Kind::kBayer, "RGGB", 8},
    {"BayerGR8", Kind::kBayer, "GRBG", 8},
    {"BayerGB8", Kind::kBayer, "GBRG", 8},
    {"BayerBG8", Kind::kBayer, "BGGR", 8},
    {"Mono16", Kind::kGray, "R", 16},
    {"Mono12", Kind::kGray, "R", 12},
    {"Mono12p", Kind::kGray, "R", 12, Packing::kBits},
    {"Mono12Packed", Kind::kGray, "R", 12, Packing::kGige},
    {"Mono10", Kind::kGray, "R", 10},
    {"Mono10p", Kind::kGray, "R", 10, Packing::kBits},
    {"Mono10Packed", Kind::kGray, "R", 10, Packing::kGige},
    {"Mono8", Kind::kGray, "R", 8},
    {"RGB8", Kind::kRgb, "RGB", 8},
    {"BGR8", Kind::kRgb, "BGR", 8},
};

double decoded(Transfer transfer, double code) {
  switch (transfer) {
    case Transfer::kLinear:
      return code;
    case Transfer::kSrgb:  // IEC 61966-2-1
      return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
    case Transfer::kRec709:  // ITU-R BT.709
      return code < 0.081 ? code / 4.5 : std::pow((code + 0.099) / 1.099, 1.0 / 0.45);
  }
  return code;
}

// Linear samples by code, both on a scale of 65535.
using DecodeTable = std::vector<std::uint16_t>;
const DecodeTable& decode_table(Transfer transfer) {
  const auto filled = [](Transfer by) {
    DecodeTable table(65536);
    for (size_t code = 0; code < table.size(); ++code)
      table[code] = code16_of(static_cast<float>(decoded(by, static_cast<double>(code) / 65535.0)));
    return table;
  };
  static const std::array<DecodeTable, 3> tables{filled(Transfer::kLinear), filled(Transfer::kSrgb),
                                                 filled(Transfer::kRec709)};
  return tables[static_cast<size_t>(transfer)];
}

// The code of sample `x` of a row.
std::uint16_t code_at(const PixelFormat& format, const std::uint8_t* row, size_t x) {
  const size_t bits = format.bits;
  switch (format.packing) {
    case Packing::kCsi2: {
      const size_t group = bits == 10 ? 4 : 2, low_bits = bits - 8;
      const std::uint8_t* bytes = row + x / group * (group + 1);
      const int low = bytes[group] >> (low_bits * (x % group)) & ((1 << low_bits) - 1);
      return static_cast<std::uint16_t>(bytes[x % group] << low_bits | low);
    }
    case Packing::kBits: {  // starts in one byte and ends in the next
      const std::uint8_t* bytes = row + x * bits / 8;
      return static_cast<std::uint16_t>((bytes[0] | bytes[1] << 8) >> (x * bits % 8) & ((1 << bits) - 1));
    }
    case Packing::kGige: {
      const size_t low_bits = bits - 8;
      const std::uint8_t* bytes = row + x / 2 * 3;
      const int low = bytes[1] >> (4 * (x % 2)) & ((1 << low_bits) - 1);
      return static_cast<std::uint16_t>(bytes[2 * (x % 2)] << low_bits | low);
    }
    case Packing::kNone:
      break;
  }
  if (bits == 8) return row[x];
  return static_cast<std::uint16_t>(row[2 * x] | row[2 * x + 1] << 8);
}

// Reads the codes of one row of a raw picture.
void unpack_row(const PixelFormat& format, const std::uint8_t* row, std::span<std::uint16_t> codes) {
  for (size_t x = 0; x < codes.size(); ++x) codes[x] = code_at(format, row, x);
}

absl::Status check_bytes(const RawPicture& picture) {
  const size_t rows = picture.height_px;
  const std::vector<size_t> plane_rows = picture.format->kind == Kind::kNv12
                                             ? std::vector<size_t>{rows, (rows + 1) / 2}
                                             : std::vector<size_t>{rows};
  const size_t row = row_bytes(*picture.format, picture.width_px);
  for (size_t p = 0; p < plane_rows.size(); ++p) {
    const size_t held = p < picture.planes.size() ? picture.planes[p].size() : 0;
    const size_t needed = (plane_rows[p] - 1) * picture.stride_bytes + row;
    if (picture.stride_bytes < row || held < needed) {
      return absl::DataLossError(fmt::format("a frame of {} x {} px in {} has {} bytes instead of {}",
                                             picture.width_px, picture.height_px, picture.format->name, held,
                                             needed));
    }
  }
  return absl::OkStatus();
}

Image16 image_of_raw(const RawPicture& picture) {
  const int width = picture.width_px, height = picture.height_px;
  const double full = (1 << picture.format->bits) - 1;
  DecodeTable linear(static_cast<size_t>(full) + 1);
  for (size_t code = 0; code < linear.size(); ++code) {
    linear[code] = code16_of(
        static_cast<float>((static_cast<double>(code) / full - picture.black) / (1.0 - picture.black)));
  }
  std::vector<std::uint16_t> codes(width);
  const int channels = picture.format->kind == Kind::kBayer ? 1 : 3;
  Image16 image(width, height, channels);
  std::uint16_t* to = image.samples.data();
  for (int y = 0; y < height; ++y) {
    unpack_row(*picture.format, picture.planes[0].data() + static_cast<size_t>(y) * picture.stride_bytes,
               codes);
    // Codes above full scale only occur in damaged frames; they are clamped.
    for (const std::uint16_t code : codes)
      to = std::fill_n(to, channels, linear[std::min<size_t>(code, linear.size() - 1)]);
  }
  return image;
}

Image16 image_of_rgb(const RawPicture& picture) {
  const std::string_view order = picture.format->order;
  const DecodeTable& table = decode_table(picture.colour.transfer);
  Image16 image(picture.width_px, picture.height_px);
  for (int y = 0; y < picture.height_px; ++y) {
    const std::uint8_t* row = picture.planes[0].data() + static_cast<size_t>(y) * picture.stride_bytes;
    for (int x = 0; x < picture.width_px; ++x, row += order.size()) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = table[row[order.find("RGB"[c])] * size_t{257}];
    }
  }
  return image;
}

Image16 image_of_ycbcr(const RawPicture& picture) {
  const ColourCode& colour = picture.colour;
  const double kg = 1.0 - colour.kr - colour.kb;
  const float luma_zero = colour.full_range ? 0.0f : 16.0f, luma_scale = colour.full_range ? 255.0f : 219.0f;
  const float chroma_scale = colour.full_range ? 255.0f : 224.0f;
  const float red_by_cr = static_cast<float>(2.0 * (1.0 - colour.kr));
  const float blue_by_cb = static_cast<float>(2.0 * (1.0 - colour.kb));
  const float green_by_cr = static_cast<float>(-2.0 * (1.0 - colour.kr) * colour.kr / kg);
  const float green_by_cb = static_cast<float>(-2.0 * (1.0 - colour.kb) * colour.kb / kg);
  const DecodeTable& table = decode_table(colour.transfer);
  const bool semi_planar = picture.format->kind == Kind::kNv12;
  const std::string_view order = picture.format->order;
  const size_t y_at = order.find('Y'), u_at = order.find('U'), v_at = order.find('V');
  Image16 image(picture.width_px, picture.height_px);
  for (int y = 0; y < picture.height_px; ++y) {
    const std::uint8_t* row = picture.planes[0].data() + static_cast<size_t>(y) * picture.stride_bytes;
    const std::uint8_t* chroma_row =
        semi_planar ? picture.planes[1].data() + static_cast<size_t>(y / 2) * picture.stride_bytes : nullptr;
    for (int x = 0; x < picture.width_px; ++x) {
      const size_t pair = static_cast<size_t>(x) / 2;
      const std::uint8_t luma_code = semi_planar ? row[x] : row[2 * static_cast<size_t>(x) + y_at];
      const std::uint8_t cb_code = semi_planar ? chroma_row[2 * pair] : row[4 * pair + u_at];
      const std::uint8_t cr_code = semi_planar ? chroma_row[2 * pair + 1] : row[4 * pair + v_at];
      const float luma = (static_cast<float>(luma_code) - luma_zero) / luma_scale;
      const float cb = (static_cast<float>(cb_code) - 128.0f) / chroma_scale;
      const float cr = (static_cast<float>(cr_code) - 128.0f) / chroma_scale;
      image.at(x, y, 0) = table[code16_of(luma + red_by_cr * cr)];
      image.at(x, y, 1) = table[code16_of(luma + green_by_cb * cb + green_by_cr * cr)];
      image.at(x, y, 2) = table[code16_of(luma + blue_by_cb * cb)];
    }
  }
  return image;
}

absl::StatusOr<Image16> image_of_jpeg(const RawPicture& picture) {
  const auto bad = [&](const std::string& what) {
    return absl::DataLossError(fmt::format("a frame is not a JPEG of {} x {} px: it is {}", picture.width_px,
                                           picture.height_px, what));
  };
  const std::vector<std::uint8_t> none, &file = picture.planes.empty() ? none : picture.planes[0];
  const std::string_view bytes(reinterpret_cast<const char*>(file.data()), file.size());
  // The codecs also decode other formats. Check format and size first.
  const absl::StatusOr<PictureSize> size = picture_size(bytes);
  if (!is_jpeg(bytes) || !size.ok()) return bad("damaged");
  if (*size != PictureSize{picture.width_px, picture.height_px})
    return bad(fmt::format("{} x {}", size->width_px, size->height_px));
  absl::StatusOr<cv::Mat> decoded = decode_picture(bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (absl::IsDataLoss(decoded.status())) return bad("damaged");
  GW_ASSIGN_OR_RETURN(const cv::Mat bgr, std::move(decoded));
  if (bgr.cols != picture.width_px || bgr.rows != picture.height_px) return bad("damaged");
  const DecodeTable& table = decode_table(picture.colour.transfer);
  Image16 image(picture.width_px, picture.height_px);
  for (int y = 0; y < bgr.rows; ++y) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    for (int x = 0; x < bgr.cols; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = table[row[3 * x + 2 - c] * size_t{257}];
    }
  }
  return image;
}

}  // namespace

int PixelFormat::group_px() const {
  if (packing == Packing::kNone) return 1;
  return packing != Packing::kGige && bits == 10 ? 4 : 2;
}

size_t row_bytes(const PixelFormat& format, int width_px) {
  const size_t width = width_px;
  if (format.kind == Kind::kRgb) return width * format.order.size();
  if (format.kind == Kind::kYuv422) return (width + 1) / 2 * 4;
  if (format.packing == Packing::kGige) return (width + 1) / 2 * 3;
  if (format.packing != Packing::kNone) return (width * static_cast<size_t>(format.bits) + 7) / 8;
  return format.bits > 8 ? width * 2 : width;
}

std::span<const PixelFormat> pixel_formats() {
  return kFormats;
}

const PixelFormat* find_pixel_format(std::string_view name) {
  const auto found = std::find_if(std::begin(kFormats), std::end(kFormats),
                                  [name](const PixelFormat& format) { return format.name == name; });
  return found == std::end(kFormats) ? nullptr : found;
}

absl::StatusOr<Image16> image_of(const RawPicture& picture) {
  assert(picture.format != nullptr && picture.width_px > 0 && picture.height_px > 0);
  if (picture.format->kind == Kind::kJpeg) return image_of_jpeg(picture);
  GW_RETURN_IF_ERROR(check_bytes(picture));
  switch (picture.format->kind) {
    case Kind::kBayer:
    case Kind::kGray:
      return image_of_raw(picture);
    case Kind::kRgb:
      return image_of_rgb(picture);
    default:
      return image_of_ycbcr(picture);
  }
}

}  // namespace glasswing
