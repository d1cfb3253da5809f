// What is known about a picture file before it is decoded: its kind, its size, and whether it is complete.
// Decoders allocate what a header promises, and fill missing data arbitrarily.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string_view>

namespace glasswing {

struct PictureSize {
  int width_px = 0, height_px = 0;
  bool operator==(const PictureSize&) const = default;
};
// The size of a PNG, JPEG, TIFF, BMP, binary PGM or PPM, or WebP. DATA_LOSS: a file of another kind, which it
// names, a damaged header, a truncated BMP or PNM, or a side that is not 1 to 16384 px.
absl::StatusOr<PictureSize> picture_size(std::string_view bytes);

// DATA_LOSS: a damaged or truncated PNG, JPEG or WebP, which decoders would still decode, or a TIFF or WebP
// of a kind that they misread; the message says which.
absl::Status check_picture(std::string_view bytes);

bool is_png(std::string_view bytes);
bool is_jpeg(std::string_view bytes);

// EXIF data of a JPEG or WebP, a TIFF without a picture; a TIFF has them itself. Empty: there are none.
std::string_view exif_of(std::string_view bytes);

}  // namespace glasswing
