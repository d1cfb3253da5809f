// A region of a picture, in the form of "--crop", and pictures sampled evenly.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string_view>

namespace glasswing {

struct MatteRegion {
  int x_px = 0, y_px = 0;  // of its top left corner
  int width_px = 0, height_px = 0;
  bool operator==(const MatteRegion&) const = default;
};

// "WIDTHxHEIGHT+X+Y". INVALID_ARGUMENT: a different form, an empty region, or a negative corner.
absl::StatusOr<MatteRegion> parse_region(std::string_view text);
// INVALID_ARGUMENT: the region is empty, or is not within a picture of this size.
absl::Status check_region(const MatteRegion& region, int width_px, int height_px);

// The requested part of a matte: every n-th pixel of every n-th row of a region, starting with the first,
// with n from sampling_step().
struct MattePart {
  std::optional<MatteRegion> region;  // absent: all there is
  std::int64_t max_pixels = 0;
};
// The smallest n, from 1, for which a picture has at most `max_pixels` pixels; 1 if that is 0 or less.
int sampling_step(int width_px, int height_px, std::int64_t max_pixels);
// The number of samples, including the first.
constexpr int sampled_length(int length_px, int step) {
  return (length_px + step - 1) / step;
}

}  // namespace glasswing
