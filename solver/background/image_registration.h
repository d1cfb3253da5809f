// How a picture of the empty stage must be moved and brightened to lie on one that was taken later, of the
// same stage with the object: cameras are touched, monitors warm up. Both are in their own codes, as shares
// of the highest:
//
//   with(p) = gain_c without(p + shift + stretch p) + offset_c,    p in px from the picture's middle
//
// by Gauss-Newton from coarse to fine, every difference weighed 1 / (1 + (r / 3 sd)^2)^2 (Geman and McClure
// 1985), sd from the median of all: the object, where nothing agrees, does not count. Where motion takes less
// than 2 % of the differences away, as where there is little to see, there is none.
#pragma once

#include <absl/status/statusor.h>

#include <array>

#include "core/frame/image.h"

namespace glasswing {

struct ImageRegistration {
  std::array<double, 2> shift_px{};
  std::array<double, 4> stretch{};  // 2x2, by rows
  std::array<double, 3> gain = {1.0, 1.0, 1.0};
  std::array<double, 3> offset{};

  // Of the corner that is moved farthest.
  double max_px(int width_px, int height_px) const;
};

// INVALID_ARGUMENT: the pictures are of different sizes.
absl::Status check_same_size(const Image16& with, const Image16& without);

// INVALID_ARGUMENT as above. FAILED_PRECONDITION says by how much they differ,
// where that is more than a drift (a corner moved by 2 % of the longer side, a gain outside [0.7, 1.4]), or
// most of it does not agree at all.
absl::StatusOr<ImageRegistration> find_drift(const Image16& with, const Image16& without);

// The empty stage as it was when the other picture was taken, bicubic (Catmull-Rom); NaN where it was not
// seen.
RadianceImage moved(const Image16& without, const ImageRegistration& drift);

}  // namespace glasswing
