// How a monitor answers codes, as a camera sees it that is linear:
//
//   m_c(k) = black_c + sum over primaries p of crosstalk_cp L_p(k_p)
//
// with L_p the tone curve of primary p (core/radiometry/tone_curve) and m_c the mean of camera channel c. A
// pattern's radiance 0 is code 0 and its radiance 1 the highest code; so a pattern's radiance is what the
// monitor shows above its black level, which is there under every picture and cancels in the difference
// from black. No radiance below the black level can be shown.
//
// Measured are solids: black, white, and grays of each primary alone. For each primary in turn, the three
// channels' m_c - black_c are brought to one curve by their noise-weighted projection on crosstalk_p, the
// curve is fitted, and crosstalk_p fitted to it by weighted least squares; twice, which is enough, since the
// first crosstalk_p, that of the highest code alone, is in error by its noise only.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <optional>
#include <vector>

#include "core/base/time.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {

// A monitor's picture of one code, and what a camera saw.
struct ShownSolid {
  std::array<int, 3> code{};      // r, g, b
  std::array<double, 3> light{};  // mean of each camera channel, linear, of the camera's full scale
  std::array<double, 3> error{};  // standard, of that mean; 0 in all solids: not known, taken to be alike
  nanoseconds at{};               // when, on any clock
};

struct DisplayResponse {
  std::array<ToneFit, 3> primary;                    // r, g, b
  std::array<std::array<double, 3>, 3> crosstalk{};  // [camera channel][primary], of camera's full scale
  std::array<double, 3> black{};                     // of each camera channel, of its full scale
  // White less the sum of primaries and black, over white; the channel where it is largest. A few thousandths
  // at most, unless auto exposure is on, or the monitor dims or has a white primary. None: no white shown.
  std::optional<double> excess_of_white;

  // What the camera sees of this code, of its full scale.
  std::array<double, 3> light(const std::array<double, 3>& code) const;
};

// INVALID_ARGUMENT: a solid that is neither black nor white nor one primary's gray. FAILED_PRECONDITION says
// in plain words what was seen: no black; light clipped (over 0.95); and what fit_tone_curve says, for each
// primary. 8 to 12 bits.
absl::StatusOr<DisplayResponse> fit_display_response(const std::vector<ShownSolid>& solids, int bits);

// The solids as they had been had the monitor not drifted: black and white, shown again from time to time,
// are interpolated in time (beyond the first and last, held), and each solid's
//
//   m -> black + (m - black(t)) (white - black) / (white(t) - black(t))
//
// in each channel, with black and white the means of all shown. In any order. FAILED_PRECONDITION: no black,
// no white, or white changes by more than a fifth from one time to the next.
absl::StatusOr<std::vector<ShownSolid>> without_drift(std::vector<ShownSolid> solids, int bits);

}  // namespace glasswing
