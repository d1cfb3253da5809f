// Radiance's .hdr: light with 8 bits per channel and one exponent for the three of a pixel (Ward 1991).
//
//   light = code * 2^(exponent - 136)
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/image/image.h"

namespace glasswing {

bool is_hdr(std::string_view bytes);
// Rows from above, columns from the left (-Y HEIGHT +X WIDTH), RGB. DATA_LOSS: damaged, another order or
// format, or a side that is not 1 to 16384 px.
absl::StatusOr<RadianceImage> decode_hdr(std::string_view bytes);
// To the nearest code; light below 0 is 0, and light above 255 * 2^119 is clamped to that.
std::string encode_hdr(const RadianceImage& image);

}  // namespace glasswing
