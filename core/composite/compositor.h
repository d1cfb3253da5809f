// The exact compositor, the reference for faster ones:
//
//   C = F + sum_i R_i \int_monitor G(x; c_i, Sigma_i) T(x) dx         (Chuang et al. 2000, eq. 12)
//
// with T constant on each monitor pixel and zero beyond the monitor's edge. Along x the Gaussian, conditioned
// on y, is integrated in closed form (differences of erf); along y by Gauss-Legendre panels no wider than a
// pixel or half the footprint's sigma. If the matte's footprints are boxes, G is a box (summed_area_table.h).
//
// If the matte holds crosstalk (core/radiometry/primary_mix), T is converted to the camera's channels, and C
// back to the monitors' primaries.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <vector>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// `backgrounds[t]` is the picture on texture t, of exactly that monitor's size; an empty one is black.
// Linear radiance in, linear radiance out (unclamped). Rows are shared among `thread_count` threads (0: all
// cores); the result does not depend on their number. `progress`, if set, is called with the fraction done.
// INVALID_ARGUMENT: a background's size is not its monitor's, or the matte's crosstalk is invalid.
absl::StatusOr<RadianceImage> composite(const Matte& matte, const std::vector<RadianceImage>& backgrounds,
                                        int thread_count = 0,
                                        const std::function<void(double)>& progress = nullptr);

// INVALID_ARGUMENT: a background's size is not its monitor's.
absl::Status check_backgrounds(const v1::MatteMetadata& metadata,
                               const std::vector<RadianceImage>& backgrounds);

// The integral of one Gaussian footprint over the pixels of `texture`, one channel. Exposed for tests.
double integrate_footprint(const Mode& mode, const RadianceImage& texture, int channel);

}  // namespace glasswing
