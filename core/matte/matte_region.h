// A region of a picture, as "--crop" names it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string_view>

namespace glasswing {

struct MatteRegion {
  int x_px = 0, y_px = 0;  // of its top left corner
  int width_px = 0, height_px = 0;
  bool operator==(const MatteRegion&) const = default;
};

// "WIDTHxHEIGHT+X+Y". INVALID_ARGUMENT: another form, an empty region, or a negative corner.
absl::StatusOr<MatteRegion> parse_region(std::string_view text);
// INVALID_ARGUMENT: the region is empty, or does not lie within a picture of this size.
absl::Status check_region(const MatteRegion& region, int width_px, int height_px);

}  // namespace glasswing
