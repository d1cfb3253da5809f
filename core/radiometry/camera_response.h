// The response of a camera, from frames of one still scene with several exposure times:
//
//   f(z_ij) = t_j E_i                              (Debevec and Malik 1997, eq. 2, with f = exp g)
//
// z_ij is the code of pixel i in frame j, t_j the exposure time, E_i the pixel's irradiance, f maps a code to
// its exposure. Debevec and Malik solve for g = ln f on some 70 pixels with a hat-shaped weight. Here
//
//   sum_ij w_ij (ln f(z_ij) - ln t_j - ln E_i)^2 + (1 / b) int (d/du d ln f / du)^2 du,  u = ln(z - black)
//
// is minimised over f, E and t on tens of thousands of pixels; f is interpolated between 256 knots
// (log_curve.h). b maximises the likelihood of the samples with f, E and t integrated out, up to the bound
// that real cameras need. Weights are inverse variances of ln f(z): the noise of codes, estimated from the
// residuals of each pass, plus the effect of a small shift of the picture at edges. Evaluating f at noisy
// codes would bias it flat; so f is evaluated at the code it predicts, and residuals are those of codes.
// Residuals beyond four standard deviations (Tukey's biweight) are rejected as motion. Pooling of adjacent
// violators keeps f monotone. Declared exposure times are inexact: each t_j may move, except for the mean and
// slope of ln t against the declared times, since f and t can be raised to any common power.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

struct Exposure {
  double exposure_s = 0.0;  // declared
  Image16 codes;            // 65535 = full scale for any bit depth; black level and curve not removed
};

struct ResponseOptions {
  // Codes without light, full scale 1. If absent, 0 is assumed, and the curve may not reach 0 exposure.
  std::optional<std::array<double, 3>> black_level;
  double darkest = 0.005;  // codes outside [darkest, saturation] are clipped
  double saturation = 0.99;
  double exposure_sd = 0.03;      // relative standard deviation of declared exposure times; > 0
  double alignment_sd_px = 0.25;  // how far frames may be shifted against each other; >= 0
};

class CameraResponse {
 public:
  static constexpr int kKnots = 256;  // at code k / 255

  // INVALID_ARGUMENT: fewer than two different exposures, a time that is not above 0, differing sizes, fewer
  // than 16 x 16 px, or options out of range. FAILED_PRECONDITION: a channel is clipped in all frames, or
  // neighbouring exposures share too few unclipped pixels.
  static absl::StatusOr<CameraResponse> fit(std::span<const Exposure> exposures,
                                            const ResponseOptions& options = {});

  // Linear exposure, 1 at the saturation level; strictly monotone. Codes are on the scale 1 = full; those
  // below the black level have exposures below 0. `code_of` clamps to [0, 1].
  double exposure_of(double code, int channel) const;
  double code_of(double exposure, int channel) const;

  // True if the curve was straight within three standard errors and 0.2 % of full scale; it is then replaced
  // by an exact line.
  bool is_linear() const { return linear_; }
  // The code at zero exposure; 0 if the curve reaches zero only below code 0.
  double black_level(int channel) const { return black_level_[channel]; }
  // The range of codes that were sampled; outside it the curve is extrapolated.
  double darkest_seen(int channel) const { return darkest_seen_[channel]; }
  double brightest_seen(int channel) const { return brightest_seen_[channel]; }
  // The standard error of the exposure at knot k, on the scale of exposure_of, assuming that mean and slope
  // of the declared times are right (an error of 1 % in d ln t / d ln declared adds 1 % of f |ln f|).
  double standard_error(int knot, int channel) const { return errors_[channel][knot]; }
  // Fitted exposure times, in the order given.
  const std::vector<double>& exposures_s() const { return exposures_s_; }

 private:
  using Curve = std::array<double, kKnots>;
  CameraResponse() = default;
  void straighten_if_linear(const ResponseOptions& options);

  std::array<Curve, 3> exposures_{};
  std::array<Curve, 3> errors_{};
  std::array<double, 3> black_level_{}, darkest_seen_{}, brightest_seen_{};
  std::vector<double> exposures_s_;
  bool linear_ = false;
};

}  // namespace glasswing
