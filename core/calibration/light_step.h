// Measures a monitor's optical lag (from scan-out to light) and settling time: from bands of its rows that
// switch between black and white at known times, and the light that a camera measured. The camera's exposures
// may be far longer than the times to be found.
//
// A band at height v (0: first row, 1: last) follows each change k, +1 to white and -1 to black, of a picture
// whose scan-out began at T_k, with a delay and linearly:
//
//   l_b(t) = sum_k (+-1) clamp((t - T_k - d_b) / w, 0, 1),     d_b = lag + scanout v_b
//
// Camera row r integrates it over its own exposure [s, e] (rolling shutter: s = start + readout r / (rows -
// 1)), with any object between monitor and camera:
//
//   m = dark_r + sum_b contrast_rb 1/(e - s) \int_s^e l_b(t) dt + noise
//
// dark and contrast are eliminated row by row (variable projection, Golub and Pereyra 1973), which leaves the
// sum of squares S(c_1, c_2, w), with c_b = d_b + w/2, where the light is half way. The posterior of delays
// and settling times is proportional to exp(-S / 2 sigma^2), w >= 0, where sigma^2 is the mean square
// residual where the light changed. Values are posterior means, errors posterior standard deviations: where
// no exposure ends within a change, the sum of squares is flat and the error large.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <vector>

#include "core/base/time.h"

namespace glasswing {

// From the picture whose scan-out began at this time on, this band is white and the others are black.
struct BandChange {
  nanoseconds scanout_start{};
  std::optional<size_t> lit;  // none: all are black
};

// One frame of the camera, on the same clock as the changes.
struct LightFrame {
  nanoseconds start{};          // of the first row's exposure
  nanoseconds exposure{};       // of each row
  nanoseconds readout{};        // from the first row's start to the last row's
  std::vector<float> row_mean;  // linear radiance
};

struct LightRecord {
  std::vector<double> band_height;  // v of each band's middle, in [0, 1]; one or two bands, narrow
  nanoseconds scanout{};            // as declared; used if only one band is seen
  std::vector<BandChange> shown;    // in time order; all bands are black before
  std::vector<LightFrame> frames;   // all with the same number of rows
};

struct LightStep {
  struct Estimate {
    nanoseconds value{};
    nanoseconds error{};  // standard error
  };
  Estimate lag;     // from a picture's scan-out start to the light of its first row
  Estimate settle;  // from a row's first light to its full light
  // From the light of the first row to that of the last; none if only one band is seen.
  std::optional<Estimate> scanout;
};

// Finds lags of 0 to 250 ms, and settling times up to the shortest time between changes. FAILED_PRECONDITION:
// no light change is seen, the lag is ambiguous (a sequence that repeats itself), or its error exceeds 1 ms.
// INVALID_ARGUMENT: no frames, or frames of different sizes.
absl::StatusOr<LightStep> find_light_step(const LightRecord& record);

// The order in which two bands, or none, are lit: 80 steps of the m-sequence s(n) = 2 s(n-3) + s(n-4) mod 3,
// which correlates with no shift of itself by less than half.
std::vector<std::optional<size_t>> band_sequence();

}  // namespace glasswing
