// What a picture's file says before it is decoded: its kind, its size, and whether all of it is there.
// Decoders allocate what a header promises, and fill what a file lacks with whatever they like.
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
// names, a damaged header, a BMP or PNM that is cut off, or a side that is not 1 to 16384 px.
absl::StatusOr<PictureSize> picture_size(std::string_view bytes);

// DATA_LOSS: a damaged or truncated PNG, JPEG or WebP, of which decoders would make a picture all the same,
// or a TIFF or WebP of a kind that they misread; it says which.
absl::Status check_picture(std::string_view bytes);

bool is_png(std::string_view bytes);
bool is_jpeg(std::string_view bytes);

// EXIF data of a JPEG or WebP, a TIFF without a picture; a TIFF has them itself. Empty: there are none.
std::string_view exif_of(std::string_view bytes);

}  // namespace glasswing
