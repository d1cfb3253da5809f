// The tone curve of one primary of a monitor: the radiance of code k above black, L(k), relative to that of
// the highest code. L(0) = 0, L(highest) = 1, and L never falls.
//
// Between two codes, radiance is interpolated: a fractional code k + f means code k + 1 on the share f of a
// surface and code k on the rest,
//
//   L(k + f) = (1 - f) L(k) + f L(k + 1)
//
// so that a dither which takes f as a probability is unbiased in radiance.
//
// The fit: lights y_i of codes k_i, with x = k / highest and noise variances w_i known up to a factor
// sigma^2:
//
//   y_i = b + a x_i^gamma + c(x_i) + noise,     Var(noise_i) = sigma^2 w_i
//
// where c, the monitor's deviation from a power law, is a Gaussian process, an integrated Wiener process of
// covariance sigma^2 tau^2 (x x' + m^3 / 3 + m^2 |x - x'| / 2), m = min(x, x'): its mean is a cubic smoothing
// spline with c(0) = 0 (Wahba 1978). gamma and tau maximise the restricted likelihood, in which a, b and
// sigma are eliminated (Patterson and Thompson 1971). So a power law is fitted by a power law, and any other
// curve is followed as far as the noise allows. Remaining falls are pooled into flat steps.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string_view>
#include <vector>

namespace glasswing {

// For a monitor that has tone curves; codes with more bits are treated as linear light.
inline constexpr int kMaxCurveBits = 12;

class ToneCurve {
 public:
  // Radiances of all 2^bits codes, 8 to kMaxCurveBits bits. INVALID_ARGUMENT if it falls, or does not go from
  // 0 to 1.
  static absl::StatusOr<ToneCurve> create(std::vector<double> radiances);
  // A power law; exponent > 0.
  static ToneCurve power(double exponent, int bits);

  int highest_code() const { return static_cast<int>(radiances_.size()) - 1; }
  std::span<const double> radiances() const { return radiances_; }

  // The radiance of a code, fractional or not; clamped to [0, highest].
  double radiance(double code) const;
  // The smallest fractional code of this radiance, which is clamped to [0, 1]. Radiance 0 is code 0.
  double code_for(double radiance) const;

 private:
  explicit ToneCurve(std::vector<double> radiances) : radiances_(std::move(radiances)) {}

  std::vector<double> radiances_;
};

struct TonePoint {
  int code = 0;
  double light = 0.0;  // linear, any unit
  double error = 0.0;  // standard error, in that unit; 0 at all points: unknown, assumed equal
};

struct ToneFit {
  ToneCurve curve;
  double gamma = 0.0;         // of the power law
  double full_scale = 0.0;    // light of the highest code above that of code 0, as fitted
  double residual_rms = 0.0;  // of the points, relative to full scale
  std::vector<double> error;  // standard error of each code's radiance
};

// `what` starts the messages: "red". INVALID_ARGUMENT: an invalid code or light. FAILED_PRECONDITION
// describes the problem of the measurement: fewer than 6 different codes, or 0 or the highest missing; light
// that falls by more than noise (4 standard errors, and 0.5 % of full scale); or no light at all.
absl::StatusOr<ToneFit> fit_tone_curve(std::vector<TonePoint> points, int bits, std::string_view what);

}  // namespace glasswing
