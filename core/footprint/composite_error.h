// The standard error of a composite C due to the frames' noise. With A a root of the covariance of a
// channel's F and modes p (matte_covariance.h), to first order
//
//   var C = |A' dC/dp|^2      dC/dF = 1   dC/dR = I   dC/dc = R dI/dc   dC/dSigma = R dI/dSigma
//
// with I and its derivatives from light_slopes.h.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// `backgrounds` and `progress` as for composite() (compositor.h); the standard error of each sample, in the
// same units. NaN where it is not known: outside the object, where the matte is flagged, and where a
// mode's own standard errors are not known.
// FAILED_PRECONDITION: the matte does not record how it was sampled. INVALID_ARGUMENT as in composite().
absl::StatusOr<RadianceImage> composite_error(const Matte& matte,
                                              const std::vector<RadianceImage>& backgrounds,
                                              int thread_count = 0,
                                              const std::function<void(double)>& progress = nullptr);

// As OpenEXR: R, G and B, and A, which is 1 where all three are known; elsewhere all are 0.
absl::StatusOr<std::string> encode_composite_error(const RadianceImage& error);

}  // namespace glasswing
