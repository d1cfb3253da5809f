// Registers a picture of the empty stage with a later one of the same stage with the object, in position and
// brightness: cameras are touched, monitors warm up. Both are in their own codes, as shares of the highest:
//
//   with(p) = gain_c without(p + shift + stretch p) + offset_c,    p in px from the picture's centre
//
// by Gauss-Newton from coarse to fine with robust weights 1 / (1 + (r / 3 sd)^2)^2 (Geman and McClure 1985),
// sd from the median, so that the object has no effect. If motion removes less than 2 % of the differences,
// as in a picture with little texture, none is assumed.
#pragma once

#include <absl/status/statusor.h>

#include <array>

#include "core/image/image.h"

namespace glasswing {

struct ImageRegistration {
  std::array<double, 2> shift_px{};
  std::array<double, 4> stretch{};  // 2x2, by rows
  std::array<double, 3> gain = {1.0, 1.0, 1.0};
  std::array<double, 3> offset{};

  // The displacement of the corner that moves farthest.
  double max_px(int width_px, int height_px) const;
};

// INVALID_ARGUMENT: the pictures are of different sizes.
absl::Status check_same_size(const Image16& with, const Image16& without);

// INVALID_ARGUMENT: see above. FAILED_PRECONDITION if the pictures differ too much (a corner moved by more
// than 2 % of the longer side, a gain outside [0.7, 1.4], or most of the picture does not agree); the message
// says by how much.
absl::StatusOr<ImageRegistration> find_registration(const Image16& with, const Image16& without);

// The empty stage, registered to the other picture by bicubic interpolation (Catmull-Rom); NaN where it was
// not seen.
RadianceImage moved(const Image16& without, const ImageRegistration& registration);

}  // namespace glasswing
