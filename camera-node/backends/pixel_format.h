// Pictures as cameras deliver them, and their conversion to linear light.
//
//   raw    sample = (code - black) / (full - black); a colour sensor's frame stays a mosaic of one channel
//   RGB    sample = decode(code / 255)
//   YCbCr  R' = Y' + 2 (1 - kr) Cr,  B' = Y' + 2 (1 - kb) Cb,  G' from Y' = kr R' + (1 - kr - kb) G' + kb B';
//          decoded as RGB. Subsampled chroma is repeated.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

struct PixelFormat {
  enum class Kind { kBayer, kGray, kRgb, kYuv422, kNv12, kJpeg };
  // How samples of 10 or 12 bits share bytes.
  enum class Packing {
    kNone,  // each has two bytes, little endian
    kCsi2,  // MIPI CSI-2: the high bytes of 4 (2) samples of 10 (12) bits, then their low bits
    kBits,  // GenICam's "p": one stream of bits, the lowest first
    kGige,  // GigE Vision's "Packed": a first sample's high byte, low bits of both, a second one's high byte
  };
  std::string_view name;  // libcamera's, or GenICam's
  Kind kind;
  std::string_view order;  // in memory: "RGGB" (two rows of two), "BGR", "YUYV"
  int bits;                // significant bits of a sample
  Packing packing = Packing::kNone;
  // A row of this many samples ends on a byte boundary.
  int group_px() const;
};

// The formats that image_of() supports, best first: raw before processed, more bits before fewer.
std::span<const PixelFormat> pixel_formats();
// Of one row, without padding.
size_t row_bytes(const PixelFormat& format, int width_px);
// Null: unsupported.
const PixelFormat* find_pixel_format(std::string_view name);

// How codes of a processed format represent light. Raw samples are linear.
struct ColourCode {
  enum class Transfer { kLinear, kSrgb, kRec709 };
  Transfer transfer = Transfer::kSrgb;
  double kr = 0.299, kb = 0.114;  // ITU-R BT.601; 0.2126 and 0.0722 in BT.709
  bool full_range = false;        // false: Y' is 16 to 235, Cb and Cr 16 to 240
};

struct RawPicture {
  const PixelFormat* format = nullptr;
  int width_px = 0, height_px = 0;
  size_t stride_bytes = 0;  // of a row; in NV12 the same for both planes
  ColourCode colour;
  double black = 0.0;                             // raw: the code of no light, as a fraction of full scale
  std::vector<std::vector<std::uint8_t>> planes;  // NV12 has two, all others one
};

// Of one channel for raw colour formats, whose `order` is the mosaic's name. DATA_LOSS: too few bytes for the
// format and size, or a JPEG that is damaged or has a different size.
absl::StatusOr<Image16> image_of(const RawPicture& picture);

}  // namespace glasswing
