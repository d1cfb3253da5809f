// The response of a monitor to codes, as a linear camera sees it:
//
//   m_c(k) = black_c + sum over primaries p of crosstalk_cp L_p(k_p)
//
// with L_p the tone curve of primary p (core/radiometry/tone_curve) and m_c the mean of camera channel c. A
// pattern's radiance 0 is code 0 and its radiance 1 the highest code. So a pattern's radiance is the light
// above the monitor's black level, which underlies every picture and cancels in the difference from black.
//
// The measurements are solids: black, white, and grays of each primary alone. For each primary, the three
// channels' m_c - black_c are reduced to one curve by their noise-weighted projection on crosstalk_p, the
// curve is fitted, and crosstalk_p is fitted to it by weighted least squares. Two passes suffice, since the
// first crosstalk_p, from the highest code alone, is off only by its noise.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>
#include <vector>

#include "core/base/time.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {

// A uniform picture of one code on a monitor, and its light as a camera measured it.
struct ShownSolid {
  std::array<int, 3> code{};      // r, g, b
  std::array<double, 3> light{};  // mean of each camera channel, linear, of the camera's full scale
  std::array<double, 3> error{};  // standard error of that mean; 0 in all solids: unknown, assumed equal
  nanoseconds at{};               // time of the measurement, on any clock
};

struct DisplayResponse {
  std::array<ToneFit, 3> primary;                    // r, g, b
  std::array<std::array<double, 3>, 3> crosstalk{};  // [camera channel][primary], of camera's full scale
  std::array<double, 3> black{};                     // of each camera channel, of its full scale
  // (white - primaries - black) / white, of the channel where it is largest. A few thousandths at most,
  // unless auto exposure is on, or the monitor dims or has a white primary. None: white was not shown.
  std::optional<double> excess_of_white;

  // Light of this code in each camera channel, of the camera's full scale.
  std::array<double, 3> light(const std::array<double, 3>& code) const;
};

// 8 to 12 bits. INVALID_ARGUMENT: a solid that is neither black nor white nor a gray of one primary.
// FAILED_PRECONDITION describes the problem of the measurement: no black, clipped light (over 0.95), or an
// error of fit_tone_curve for a primary.
absl::StatusOr<DisplayResponse> fit_display_response(const std::vector<ShownSolid>& solids, int bits);

// Removes the monitor's drift: black and white, shown repeatedly, are interpolated in time (held before the
// first and after the last), and each solid's light is mapped by
//
//   m -> black + (m - black(t)) (white - black) / (white(t) - black(t))
//
// in each channel, with black and white the means of all shown. Solids may come in any order.
// FAILED_PRECONDITION: no black, no white, or white changes by more than a fifth from one showing to the
// next.
absl::StatusOr<std::vector<ShownSolid>> without_drift(std::vector<ShownSolid> solids, int bits);

}  // namespace glasswing
