// The response of a camera, from frames of one still scene with several exposure times:
//
//   f(z_ij) = t_j E_i                              (Debevec and Malik 1997, eq. 2, with f = exp g)
//
// z_ij is the code of pixel i in frame j, t_j the exposure time, E_i the pixel's irradiance, f the exposure
// that a code stands for. Debevec and Malik solve for g = ln f on some 70 pixels with a hat-shaped weight.
// Here
//
//   sum_ij w_ij (ln f(z_ij) - ln t_j - ln E_i)^2 + (1 / b) int (d/du d ln f / du)^2 du,  u = ln(z - black)
//
// is least over f, E and t, with tens of thousands of pixels; log_curve.h says what f is between 256 knots.
// b is what makes the samples likeliest (f, E and t integrated out), up to what cameras need. Weights are the
// inverse variance of ln f(z): the codes' noise, which the residuals of each pass tell, and what a small
// shift of the picture does where it has edges. Reading f at noisy codes would make it flat wherever that
// hides noise; so f is read at the code that it predicts, and residuals are those of codes. Those beyond four
// standard deviations (Tukey's biweight) do not count: something moved. Pooling of adjacent violators keeps f
// monotone. A shutter's times are not what its dial says: each may move, but for mean and slope of ln t
// against what is declared, since f and t may be raised to any power together.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

struct Exposure {
  double exposure_s = 0.0;  // as declared
  Image16 codes;            // 65535 = full scale, whatever the camera's bits; black level and curve left in
};

struct ResponseOptions {
  // Codes without light, full scale 1; otherwise taken for 0, and the curve may end above.
  std::optional<std::array<double, 3>> black_level;
  double darkest = 0.005;  // codes outside [darkest, saturation] are clipped
  double saturation = 0.99;
  double exposure_sd = 0.03;      // relative standard deviation of declared exposure times; > 0
  double alignment_sd_px = 0.25;  // how far frames may be shifted against each other; >= 0
};

class CameraResponse {
 public:
  static constexpr int kKnots = 256;  // at code k / 255

  // INVALID_ARGUMENT: fewer than two different exposures, a time that is not above 0, sizes that differ, less
  // than 16 x 16 px, options out of range. FAILED_PRECONDITION: a channel is clipped in all frames, or
  // neighbouring exposures share too few pixels that neither clips.
  static absl::StatusOr<CameraResponse> fit(std::span<const Exposure> exposures,
                                            const ResponseOptions& options = {});

  // Linear, 1 at the saturation level; strictly monotone. Codes are on the scale 1 = full; those below the
  // black level give exposures below 0. `code_of` keeps to [0, 1].
  double exposure_of(double code, int channel) const;
  double code_of(double exposure, int channel) const;

  // The curve is straight within three standard errors and 0.2 % of full scale; it then is exactly straight.
  bool is_linear() const { return linear_; }
  // The code where the exposure is zero; 0 if the curve meets zero below the codes there are.
  double black_level(int channel) const { return black_level_[static_cast<size_t>(channel)]; }
  // The codes that pixels were seen at; outside, the curve is continued.
  double darkest_seen(int channel) const { return darkest_seen_[static_cast<size_t>(channel)]; }
  double brightest_seen(int channel) const { return brightest_seen_[static_cast<size_t>(channel)]; }
  // Of the exposure at knot k, on the scale of exposure_of, if the declared times are right on the whole (an
  // error of 1 % in d ln t / d ln declared is one of 1 % of f |ln f|).
  double standard_error(int knot, int channel) const {
    return errors_[static_cast<size_t>(channel)][static_cast<size_t>(knot)];
  }
  // As fitted, in the order given.
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
