// Frame files: little-endian TIFF 6.0 of 16-bit samples, r, g, b or one channel (mosaic.h), rows from the
// top. A plain file has all samples from byte kTiffPixelOffset on, so rows can be used in place. A compressed
// one has strips of a few rows, each compressed separately (Zstandard, TIFF's compression 50000, with or
// without TIFF's predictor 2), so that rows are read without the rest of the frame.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/image/image.h"
#include "core/image/mosaic.h"

namespace glasswing {

enum class FrameForm { kPlain, kCompressed };

inline constexpr size_t kTiffPixelOffset = 256;
// The size of a plain file, which is the maximum for a frame's file.
inline size_t tiff_size_bytes(const FrameShape& shape) {
  return kTiffPixelOffset + 2 * shape.row_samples() * static_cast<size_t>(shape.height_px);
}
// kCompressed: still plain if compression would save less than an eighth.
std::string encode_tiff(const Image16& image, FrameForm form = FrameForm::kPlain);
// DATA_LOSS unless `bytes` is in a form that encode_tiff writes.
absl::StatusOr<Image16> decode_tiff(std::string_view bytes);

// The maximum number of first bytes that show whether a file is in a form of encode_tiff.
size_t tiff_head_bytes(const FrameShape& shape);
// DATA_LOSS unless a file of `file_bytes` bytes that begins with `head` has a form of encode_tiff, for a
// frame of this shape. The content of a compressed one's strips is only checked when they are read.
absl::Status check_tiff_head(std::string_view head, size_t file_bytes, const FrameShape& shape);

// The rows of a frame's file in memory.
class TiffRows {
 public:
  // Errors are check_tiff_head's. `bytes`, the whole file, must outlive the object.
  static absl::StatusOr<TiffRows> open(std::string_view bytes, const FrameShape& shape);

  // All samples of a plain file, in place. Empty: the file is compressed.
  std::span<const std::uint16_t> plain() const { return plain_; }
  // For a compressed file: how many rows are decompressed at a time, from a multiple of it on.
  int strip_rows() const;
  // Writes the samples of rows [first_row, first_row + row_count), which the frame must have. DATA_LOSS: a
  // strip is damaged.
  absl::Status read(int first_row, int row_count, std::uint16_t* samples) const;

 private:
  TiffRows(std::string_view bytes, const FrameShape& shape) : bytes_(bytes), shape_(shape) {}

  std::string_view bytes_;
  FrameShape shape_;
  std::span<const std::uint16_t> plain_;
  bool has_differences_ = false;
};

}  // namespace glasswing
